"""The cases: all scenes, further uses of runs, and laboratory tests."""

from __future__ import annotations

import os
import signal
import threading
import warnings
from collections.abc import Callable
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from math import pi, sin
from pathlib import Path
from typing import Any

import sandboil as sb
from sandboil import lab
from sandboil.site import deconvolution

from . import scenes
from .quantities import Found, of_ground, of_run, of_stage, of_test, planned, text_digest, value


@dataclass(frozen=True)
class Result:
    """Bits of a case, and the sizes and texts of its plan, which may change while the bits stay."""

    bits: Found
    plan: Found = field(default_factory=dict)


# Computes a case with so many threads in a given folder.
Case = Callable[[int, Path], Result]


def _simulated(simulation: sb.Simulation) -> Result:
    """Run a simulation through all its stages."""
    scene = simulation.scene
    bits, plan = {"at rest": of_ground(simulation)}, {}
    for stage in scene.stage_names[scene.stage_names.index(simulation.stage) :]:
        simulation.run_stage()
        assert simulation.stage == stage
        bits[stage], plan[stage] = of_stage(simulation), planned(simulation)
    plan["scene"] = {
        "physics": text_digest(scene.active_physics()),
        "doubts": text_digest(simulation.doubts),
    }
    return Result(bits, plan)


def _scene(build: Callable[[Path], sb.Scene]) -> Case:
    def case(threads: int, folder: Path) -> Result:
        scene = build(folder)
        keeps = "free-field" in scene.side_kinds and scene.seepage is None
        return _simulated(sb.Simulation(scene, threads, keep_columns=keeps))

    return case


def _restored(name: str, steps: int) -> Case:
    """A scene that is stored in its last stage after some steps, and continued by another simulation."""

    def case(threads: int, folder: Path) -> Result:
        scene = scenes.ALL[name](folder)
        first = sb.Simulation(scene, threads)
        for _ in scene.stages[:-1]:
            first.run_stage()
        assert first.step(steps) == steps
        first.store(folder / "state")
        second = sb.Simulation(scene, threads)
        second.restore(folder / "state", scene.stage_names[-1])
        return Result(_simulated(second).bits)

    return case


def _read(name: str, **options: Any) -> Case:
    """A scene by `sandboil.run`, read from its folder."""

    def case(threads: int, folder: Path) -> Result:
        scene = scenes.ALL[name](folder)
        sb.run(scene, folder / "run", threads, progress=False, **options)
        return Result(of_run(sb.load(folder / "run")))

    return case


def _seepage_read(threads: int, folder: Path) -> Result:
    """The water of a run with a seepage stage."""
    found: Found = {}
    for name in ("steady seepage", "seepage in time"):
        run = sb.run(scenes.ALL[name](folder), folder / name, threads, progress=False)
        fields = {field: run.seepage_field(field) for field in ("pore_pressure", "head", "saturation")}
        discharge = [inflow for _, inflow in run.discharge]
        found[name] = {name: value(each) for name, each in {**fields, "discharge": discharge}.items()}
        if run.water_balance is not None:
            found[name] |= {"inflow": value(run.water_balance[0]), "stored": value(run.water_balance[1])}
    return Result(found)


@contextmanager
def _interrupted_in(stage: str, folder: Path) -> Any:
    """Ask the run in a folder to stop as soon as a stage has begun, as Ctrl-C does."""
    is_over = threading.Event()

    def has_begun() -> bool:
        with suppress(sb.InvalidInput, sb.SandboilError, OSError, KeyError):
            return stage in sb.load(folder).stages
        return False

    def ask() -> None:
        while not is_over.wait(0.01):
            if has_begun():
                os.kill(os.getpid(), signal.SIGINT)

    before = signal.signal(signal.SIGINT, lambda number, frame: None)
    thread = threading.Thread(target=ask)
    thread.start()
    try:
        yield
    finally:
        is_over.set()
        thread.join()
        signal.signal(signal.SIGINT, before)


def _resumed(threads: int, folder: Path) -> Result:
    """A run that is interrupted in its first shaking, and resumed."""
    scene, out = scenes.free_field(folder), folder / "run"
    with _interrupted_in("shaking", out), suppress(sb.RunInterrupted):
        sb.run(scene, out, threads, progress=False, checkpoint_seconds=None, checkpoint_time=0.1)
    run = sb.run(scene, out, threads, progress=False, resume=True)
    assert run.resumed == 1, "it was not interrupted in time"
    return Result(of_run(run))


def _begun_elsewhere(threads: int, folder: Path) -> Result:
    """A run that begins where another one has ended its stage of gravity."""
    first = scenes.dry_above_water(folder)
    shaken = (first.stages[0], sb.Shaking(scenes.WEAK_PULSE, duration=0.3))
    run = sb.run(first, folder / "first", threads, progress=False)
    second = sb.run(
        first.model_copy(update={"stages": shaken}),
        folder / "second",
        threads,
        progress=False,
        start=(run, "gravity"),
    )
    return Result(of_run(second))


def _columns_read(threads: int, folder: Path) -> Result:
    """Columns that one run keeps and another reads."""
    bits: Found = {}
    for name in ("wall and column", "column and wall"):
        scene = scenes.ALL[name](folder)
        sb.run(scene, folder / name, threads, progress=False, keep_columns=True)
        again = _simulated(sb.Simulation(scene, threads, columns=folder / name))
        bits |= {f"{name}, {stage}": found for stage, found in again.bits.items()}
    return Result(bits)


def _plan(threads: int, folder: Path) -> Result:
    """The part of a plan that does not depend on the clock."""
    found: Found = {}
    for name in ("undrained pond", "column and wall", "dry heap"):
        plan = scenes.ALL[name](folder).plan()
        found[name] = {
            "nodes": plan.nodes,
            "stress nodes": plan.stress_nodes,
            "pairs": plan.pairs,
            "file size": plan.file_size,
            "physics": text_digest(plan.physics),
            **{f"bytes {array}": size for array, size in plan.arrays.items()},
            **{f"coefficient {region}": value(b) for region, b in plan.pore_pressure_coefficients.items()},
            **{f"time step {stage.name}": value(stage.dt) for stage in plan.stages},
        }
    return Result({}, found)


class Hooke:
    """A model written by a user."""

    def initialise(self, stress: Any, void_ratio: float | None) -> Any:
        return stress

    def update(self, state: Any, strain: Any) -> Any:
        (xx, yy, xy, zz), (exx, eyy, gxy) = state, strain
        p, g = 7.0e4 * (exx + eyy), 3.0e4
        return xx + p + 2.0 * g * exx, yy + p + 2.0 * g * eyy, xy + g * gxy, zz + p

    def stress(self, state: Any) -> Any:
        return state

    def moduli(self, state: Any) -> tuple[float, float]:
        return 3.0e4, 9.0e4


def _laboratory(threads: int, folder: Path) -> Result:
    """Every test of the laboratory on one sand, and a cyclic one on every soil."""
    sand = scenes.LOOSE
    cyclic = lab.cyclic_dss(sand, csr=0.15, max_cycles=3)
    legs = [(0.0, 0.0, 2.0e-3), (1.0e-4, -2.0e-4, -1.0e-3), (0.0, -1.0e-3, 0.0)]
    stresses = [(-60.0, -110.0, 5.0), (-55.0, -100.0, -8.0)]
    tests = {
        "cyclic": cyclic,
        "cyclic, inclined": lab.cyclic_dss(
            scenes.MEDIUM,
            csr=0.2,
            static_shear_ratio=0.1,
            sigma_v0=80.0,
            K0=0.6,
            max_cycles=2,
            integrator="rk4",
        ),
        "irregular": lab.cyclic_dss(sand, reversals=[0.08, -0.1, 0.12], tolerance=1.0e-6),
        "by strain, drained": lab.cyclic_dss(
            sand, gamma_reversals=[2.0e-3, -2.0e-3, 1.0e-3], drained=True, void_ratio=0.68
        ),
        "monotonic": lab.monotonic_dss(scenes.MEDIUM, gamma_max=0.03, integrator="reference"),
        "strain path": lab.strain_path(sand, stress0=(-50.0, -100.0, 0.0), strain=legs),
        "stress path": lab.stress_path(sand, stress0=(-50.0, -100.0, 0.0, -50.0), stress=stresses),
        "compression, drained": lab.plane_strain_compression(sand, drained=True, axial_strain_max=0.01),
        "compression": lab.plane_strain_compression(sand, axial_strain_max=0.01),
        "reconsolidation": lab.reconsolidation(cyclic),
        "modulus": lab.modulus_reduction(sand, strains=[1.0e-5, 1.0e-4, 1.0e-3], cycles=2),
        "own model": lab.strain_path(Hooke(), stress0=(-50.0, -100.0, 0.0), strain=legs),
    }
    soils = (scenes.ROCK, scenes.GRAVEL, scenes.CLAY, scenes.SOFT_CLAY, scenes.SOFTENING, scenes.SILT)
    for soil in soils:
        tests[f"cyclic, {soil.kind} {soil.shear_modulus:g}"] = lab.cyclic_dss(
            soil, csr=0.2, max_cycles=2, gamma_stop=0.02, sigma_v0=40.0
        )
    return Result({name: of_test(test) for name, test in tests.items()})


def _resistance(threads: int, folder: Path) -> Result:
    """Cyclic resistance, its curve, and a sand that is calibrated to one."""
    curve = lab.crr_curve(scenes.LOOSE, csr=[0.12, 0.2])
    sand = lab.calibrate_hpo(Dr=0.5, G0=600.0, crr=0.14, cycles=5)
    return Result(
        {
            "resistance": {"in 5 cycles": value(lab.crr(scenes.LOOSE, cycles=5.0))},
            "curve": {name: value(column) for name, column in curve.columns().items()},
            "calibration": {"hpo": value(sand.hpo)},
        }
    )


def _site(threads: int, folder: Path) -> Result:
    """The profile of a scene, and the motion at its base that belongs to one at its surface."""
    found: Found = {}
    for curves in ("darendeli", "material"):
        profile = scenes.explicit_flow(folder).profile(curves=curves, thickness=4.0)
        deconvolved = deconvolution(scenes.PULSE, profile)
        found[curves] = {
            "unit weight": value([layer.unit_weight for layer in profile.layers]),
            "shear wave velocity": value([layer.Vs for layer in profile.layers]),
            "travel time": value(profile.travel_time),
            "motion": value(deconvolved.motion.acceleration_g),
            "strain": value(deconvolved.strain),
            "stiffness": value(deconvolved.G_ratio),
            "damping": value(deconvolved.damping),
        }
    return Result(found)


def _shear_cell(threads: int, folder: Path) -> Result:
    """The cell of particles, of sand and of a soil that softens."""
    lattice: dict[str, Any] = {"spacing": 0.02, "size": 0.28, "free_size": 0.08, "max_cycles": 1}
    tests = {
        "sand": lab.shear_cell(scenes.LOOSE, csr=0.15, threads=threads, **lattice),
        "dense sand": lab.shear_cell(
            scenes.MEDIUM,
            csr=0.3,
            void_ratio=0.65,
            integrator="rk4",
            smoothing_ratio=1.5,
            threads=threads,
            **lattice,
        ),
        "clay": lab.shear_cell(
            scenes.CLAY,
            csr=0.1,
            sigma_v0=60.0,
            K0=0.7,
            local_damping=0.1,
            velocity_filter=0.5,
            density=1.8,
            inertia=0.01,
            strain_step=1.0e-4,
            threads=threads,
            **lattice,
        ),
    }
    return Result({name: of_test(test) for name, test in tests.items()})


def _motions(threads: int, folder: Path) -> Result:
    """Motions from every source, and what is made of them."""
    samples = [0.1 * sin(2.0 * pi * k / 40.0) * (1.0 - k / 200.0) for k in range(201)]
    record = folder / "record.AT2"
    rows = "\n".join(f"{sample!r}" for sample in samples)
    record.write_text(
        f"RECORD\nOF A TEST\nACCELERATION IN UNITS OF G\nNPTS= {len(samples)}, DT= 0.01 SEC\n{rows}\n"
    )
    given = sb.Motion(dt=0.01, acceleration_g=samples)
    motions = {
        "ricker": scenes.PULSE,
        "synthetic": sb.Motion.synthetic(pga_g=0.3, duration=2.0, seed=2, pgv=0.1),
        "given": given,
        "file": sb.Motion.from_file(record),
        "scaled": given.scaled(pga_g=0.25),
        "flipped": given.flipped(),
        "corrected": given.baseline_corrected(),
        "filtered": given.filtered(0.5, 20.0),
    }
    found: Found = {}
    for name, motion in motions.items():
        found[name] = {
            "acceleration": value(motion.acceleration_g),
            "velocity": value(motion.velocity),
            "displacement": value(motion.displacement),
            "upgoing velocity": value(motion.upgoing_velocity()[1]),
            "Arias intensity": value(motion.arias),
            "significant duration": value(motion.d5_95),
            "spectrum": value(motion.response_spectrum().psa_g),
        }
    return Result(found)


CASES: dict[str, Case] = {
    **{name: _scene(build) for name, build in scenes.ALL.items()},
    "explicit flow, restored": _restored("explicit flow", 300),
    "seepage in time, restored": _restored("seepage in time", 100),
    "slope run out, restored": _restored("slope run out", 300),
    "column and wall, restored": _restored("column and wall", 200),
    "inclined run out, restored": _restored("inclined run out", 300),
    "moving water, restored": _restored("moving water", 150),
    "corrected, restored": _restored("corrected", 200),
    "dual sand, restored": _restored("dual sand", 200),
    "dual heap, restored": _restored("dual heap", 300),
    "undrained pond, read": _read("undrained pond"),
    "dry above water, read": _read("dry above water", accuracy="draft"),
    "slope run out, read": _read("slope run out", accuracy="reference"),
    "seepage, read": _seepage_read,
    "resumed": _resumed,
    "begun elsewhere": _begun_elsewhere,
    "columns read": _columns_read,
    "plan": _plan,
    "laboratory": _laboratory,
    "resistance": _resistance,
    "shear cell": _shear_cell,
    "site": _site,
    "motions": _motions,
}


def computed(name: str, threads: int, folder: Path) -> Result:
    """A case, without the warnings of doubts: those are among what is planned."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", sb.SandboilWarning)
        return CASES[name](threads, folder)
