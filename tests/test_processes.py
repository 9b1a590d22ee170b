"""Several simulations at once: in one thread by turns, in several threads and in several processes."""

from __future__ import annotations

import copy
import multiprocessing
import os
import pickle
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import bad_inputs
import numpy as np
import pytest
import sandboil as sb
import scenes
from sandboil import Gravity, Region, Scene, Shaking, Simulation, box
from sandboil.core.simulation import LOOK_INTERVAL

# Wall time after which a process or thread is taken to hang, s.
PATIENCE = 120.0
# A fork of a process that has threads is what is tested.
pytestmark = pytest.mark.filterwarnings("ignore:.*multi-threaded.*:DeprecationWarning")

Fields = dict[str, np.ndarray]


def ground(height: float = 4.0) -> Scene:
    """So many nodes that threads share the loops over them."""
    return scenes.column(
        regions=[
            Region("loose", box(x=(0, 4), y=(2, height)), scenes.LOOSE, hydraulic_conductivity=1e-4, Gs=2.67),
            Region("dense", box(x=(0, 4), y=(0, 2)), scenes.DENSE, hydraulic_conductivity=1e-4, Gs=2.67),
        ],
        stages=[Gravity(tolerance=1e-3), Shaking(scenes.PULSE, duration=0.2)],
        output=sb.Output(),
    )


def fields(simulation: Simulation) -> Fields:
    return simulation.fields(["displacement", "velocity", "sigma_v_eff", "excess_pore_pressure"])


def computed(height: float = 4.0, threads: int = 2) -> Fields:
    simulation = Simulation(ground(height), threads=threads)
    simulation.run_stage()
    simulation.run_stage()
    return fields(simulation)


def assert_same(found: Fields, expected: Fields) -> None:
    for name, values in expected.items():
        np.testing.assert_array_equal(found[name], values, err_msg=name, strict=True)


@pytest.fixture(scope="module")
def alone() -> dict[float, Fields]:
    """The results of two simulations, each computed alone."""
    return {height: computed(height) for height in (4.0, 4.5)}


def test_simulations_by_turns_are_as_alone(alone: dict[float, Fields]) -> None:
    both = {height: Simulation(ground(height), threads=2) for height in alone}
    while not all(simulation.is_complete for simulation in both.values()):
        for simulation in both.values():
            simulation.step(7)
    for height, simulation in both.items():
        assert_same(fields(simulation), alone[height])


def test_simulations_in_threads_are_as_alone(alone: dict[float, Fields]) -> None:
    found: dict[float, Fields] = {}
    threads = [
        threading.Thread(target=lambda height=height: found.update({height: computed(height)}))
        for height in alone
    ]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(PATIENCE)
    assert found.keys() == alone.keys()
    for height, expected in alone.items():
        assert_same(found[height], expected)


def test_python_continues_while_the_core_computes() -> None:
    """If the core held the interpreter, this thread would run only when the core checks for a signal."""
    simulation = Simulation(ground(), threads=2)
    simulation.run_stage()
    thread = threading.Thread(target=simulation.run_stage)
    turns, start = 0, time.monotonic()
    thread.start()
    while thread.is_alive():
        turns += 1
        time.sleep(0.001)
    looks = (time.monotonic() - start) / LOOK_INTERVAL + 1.0
    assert turns > 3.0 * looks


THREADS = """
from pathlib import Path
from time import monotonic, sleep
from test_processes import Simulation, ground

def count():
    return len(list(Path("/proc/self/task").iterdir()))

before = count()
three, one = Simulation(ground(), threads=3), Simulation(ground(), threads=1)
three.step(2), one.step(2)
assert count() == before + 3, count()
del three
end = monotonic() + 10.0
while count() > before:
    assert monotonic() < end, "its threads are still there"
    sleep(0.01)
"""


@pytest.mark.skipif(not Path("/proc/self/task").exists(), reason="the system does not list its threads")
def test_each_simulation_starts_and_ends_its_own_threads() -> None:
    """In a separate process, because threads of other tests may not have ended yet."""
    done = subprocess.run(
        [sys.executable, "-c", THREADS],
        capture_output=True,
        text=True,
        cwd=Path(__file__).parent,
        check=False,
    )
    assert done.returncode == 0, done.stderr


def test_an_interrupted_step_leaves_the_simulation_readable() -> None:
    """Ctrl-C in a notebook: the core returns between two steps, and continues bit for bit on request."""
    # So long that it cannot end before the interruption.
    endless = ground().changed(**{"stages[1].duration": 1e4})
    simulation = Simulation(endless, threads=2)
    simulation.run_stage()
    threading.Timer(0.02, os.kill, (os.getpid(), signal.SIGINT)).start()
    with pytest.raises(KeyboardInterrupt):
        simulation.step(10**9)
    assert not simulation.is_complete
    assert np.isfinite(simulation.field("velocity")).all()
    simulation.step(100)
    straight = Simulation(endless, threads=2)
    straight.run_stage()
    straight.step(simulation.steps)
    assert_same(fields(simulation), fields(straight))


SCENES: dict[str, Callable[[], Scene]] = {
    "level": lambda: Scene(**bad_inputs.SOUND),
    "seeping": lambda: Scene(**bad_inputs.SEEPING),
    "slope": lambda: Scene(**bad_inputs.SLOPE),
    "shaken": ground,
}


@pytest.mark.parametrize("name", SCENES)
@pytest.mark.parametrize(
    "copied",
    [lambda scene: pickle.loads(pickle.dumps(scene)), copy.copy, copy.deepcopy],
    ids=["pickle", "copy", "deepcopy"],
)
def test_a_copied_scene_is_the_scene(name: str, copied: Callable[[Scene], Scene]) -> None:
    scene = SCENES[name]()
    again = copied(scene)
    assert again == scene
    # Given values and defaults stay distinct, too.
    assert again.to_toml() == scene.to_toml()
    assert again.to_toml(resolved=True) == scene.to_toml(resolved=True)


def work(results: Any, scene: Scene, inherited: Simulation | None) -> None:
    """The work of a worker: its own scene, and the rest of a simulation that it was forked with."""
    simulation = Simulation(scene, threads=2)
    simulation.run_stage()
    simulation.run_stage()
    own = fields(simulation)
    if inherited is not None:
        inherited.run_stage()
    results.put((own, None if inherited is None else fields(inherited)))


@pytest.mark.parametrize("method", ["fork", "spawn"])
def test_workers_compute_what_their_parent_would(method: str, alone: dict[float, Fields]) -> None:
    """Also after the parent has used its threads, which a forked worker does not have."""
    if method not in multiprocessing.get_all_start_methods():
        pytest.skip(f"the system cannot {method}")
    context = multiprocessing.get_context(method)
    present = Simulation(ground(), threads=2)
    present.run_stage()
    results: Any = context.Queue()
    # A simulation cannot be sent to a worker; a forked worker has it already.
    inherited = present if method == "fork" else None
    worker = context.Process(target=work, args=(results, ground(4.5), inherited))
    worker.start()
    try:
        own, gone_on_with = results.get(timeout=PATIENCE)
        worker.join(PATIENCE)
        assert worker.exitcode == 0
    finally:
        worker.kill()
    assert_same(own, alone[4.5])
    if gone_on_with is not None:
        assert_same(gone_on_with, alone[4.0])
    # The parent's simulation is as it was.
    present.run_stage()
    assert_same(fields(present), alone[4.0])


def test_a_simulation_is_not_pickled() -> None:
    with pytest.raises(TypeError, match="cannot pickle"):
        pickle.dumps(Simulation(ground(), threads=1))
