"""What a run holds: bars on resident memory, and none that grows."""

import subprocess
import sys
from pathlib import Path

import pytest

TESTS = Path(__file__).parent

# Resident memory a coupled run of 20,000 nodes may take, MB.
BAR = 400.0

# What the interpreter's own caches may still take after a run has settled, MB.
SETTLING = 2.0

SCENE = """
import resource, sys
sys.path.insert(0, {tests!r})
import scenes
import sandboil as sb

def resident():
    "Present and largest resident memory, MB."
    pages = int(open("/proc/self/statm").read().split()[1])
    return pages * resource.getpagesize() / 1e6, resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e3

def simulation(width, height, spacing):
    sand = sb.PM4Sand(Dr=0.55, G0=677.0, hpo=0.4)
    ground = sb.Region(
        "sand", sb.box(x=(0, width), y=(0, height)), sand, hydraulic_conductivity=1e-4, Gs=2.65
    )
    shaken = sb.Shaking(sb.Motion.ricker(2.0, 0.1), duration=1000.0)
    stages = [sb.Gravity(tolerance=0.05), shaken]
    scene = scenes.column(regions=[ground], spacing=spacing, stages=stages)
    made = sb.Simulation(scene, threads=1)
    made.run_stage()
    return made
"""


def measured(code: str) -> list[float]:
    """The numbers that a fresh interpreter prints."""
    source = SCENE.format(tests=str(TESTS)) + code
    done = subprocess.run([sys.executable, "-c", source], capture_output=True, text=True, check=True)
    return [float(word) for word in done.stdout.split()]


GROWTH = """
made = simulation(0.6, 4.0, 0.2)
made.step(2000)
made.take_histories()
before, _ = resident()
for _ in range({thousands}):
    made.step(1000)
    made.take_histories()
print(resident()[0] - before)
"""


@pytest.mark.parametrize("thousands", [3, pytest.param(100, marks=pytest.mark.slow)])
def test_memory_does_not_grow(thousands: int) -> None:
    (growth,) = measured(GROWTH.format(thousands=thousands))
    print(f"{thousands} thousand steps: {growth:+.2f} MB")
    assert growth < SETTLING


@pytest.mark.slow
def test_a_run_of_20_000_nodes_stays_below_the_bar() -> None:
    code = (
        "made = simulation(40.0, 20.0, 0.2)\nmade.step(50)\nprint(len(made.particles.position), *resident())"
    )
    nodes, now, most = measured(code)
    print(f"{nodes:.0f} nodes: {now:.0f} MB, at most {most:.0f} MB")
    assert nodes == 20_000
    assert most < BAR
