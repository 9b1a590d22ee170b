"""The shear cell from Python: what it gives, what options change, what it refuses."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import pytest
import sandboil as sb
from sandboil.lab import ShearCell, shear_cell

SAND = sb.PM4Sand(Dr=0.35, G0=476, hpo=0.53)


def cell(soil: Any = SAND, **changes: Any) -> ShearCell:
    """A small test: 4 by 4 free nodes, two reversals."""
    arguments: dict[str, Any] = {"csr": 0.15, "max_cycles": 0.75, "spacing": 0.02, "size": 0.28}
    return shear_cell(soil, **(arguments | {"free_size": 0.08} | changes))


@pytest.fixture(scope="module")
def found() -> ShearCell:
    return cell()


def test_the_centre_follows_the_stress_that_was_asked_for(found: ShearCell) -> None:
    target = 0.15 * 101.3
    np.testing.assert_allclose(np.abs(found.tau[found.turns]), target, rtol=0.002)
    assert found.tau[found.turns[0]] > 0.0 > found.tau[found.turns[1]]
    np.testing.assert_allclose(found.cycle[found.turns], [0.25, 0.75])
    assert 0.0 <= found.report.overshoot < 0.002
    # Constant volume: the sand contracts, so the stress falls.
    assert found.r_u[0] == pytest.approx(0.0, abs=1e-12)
    assert found.r_u[-1] > 0.1
    np.testing.assert_allclose(found.r_u, 1.0 - found.sigma_v_eff / 101.3)
    assert found.sigma_h_eff[0] == pytest.approx(0.5 * 101.3)


def test_the_centre_stays_homogeneous_without_resets(found: ShearCell) -> None:
    report = found.report
    assert report.gamma_spread < 1e-4
    assert report.tau_spread < 0.2
    assert report.volume_strain < 1e-5


def test_fields_are_those_of_the_lattice(found: ShearCell) -> None:
    assert found.position.shape == found.velocity.shape == (196, 2)
    assert found.free.sum() == 16
    held = found.position[~found.free]
    sheared = held[:, 0] - np.tile(np.arange(14) * 0.02 + 0.01, 14)[~found.free]
    # Eq. 17: displacement grows with height from the block's centre, and nothing moves vertically.
    np.testing.assert_allclose(sheared, found.gamma[-1] * (held[:, 1] - 0.14), atol=1e-6)
    np.testing.assert_array_equal(found.velocity[~found.free][:, 1], 0.0)
    computed = ~np.isnan(found.node_tau)
    assert 2 * computed.sum() == found.report.computed_stress_nodes < found.report.stress_nodes == 392
    assert found.node_tau[found.free].mean() == pytest.approx(found.tau[-1])


def test_soil_that_nothing_feels_changes_no_bit(found: ShearCell) -> None:
    few, all_nodes = found, cell(every_stress_node=True)
    for name in ("gamma", "tau", "sigma_v_eff", "sigma_h_eff", "cycle", "position", "velocity"):
        np.testing.assert_array_equal(getattr(few, name), getattr(all_nodes, name), err_msg=name)
    assert all_nodes.report.computed_stress_nodes == 392
    updates = few.report.counters["plastic_updates"]
    assert updates == few.report.steps * few.report.computed_stress_nodes


@pytest.mark.parametrize("threads", [2, 3])
def test_threads_give_the_same_bits(threads: int) -> None:
    # Finer, so that the loop over the soil is long enough for threads.
    changes: dict[str, Any] = {"spacing": 0.01, "size": 0.2, "max_cycles": 0.25}
    one, several = cell(**changes), cell(**changes, threads=threads)
    assert one.report.computed_stress_nodes >= 256
    for field in dataclasses.fields(ShearCell):
        if field.name != "report":
            ours, theirs = getattr(one, field.name), getattr(several, field.name)
            np.testing.assert_array_equal(ours, theirs, err_msg=field.name, strict=True)


def test_elastic_soil_is_sheared_along_its_modulus() -> None:
    found = cell(sb.Elastic(G=2.0e4, K=4.0e4), max_cycles=0.75)
    # Jaumann rate: shear turns the difference of the normal stresses, G - (sigma_v - sigma_h)/2.
    modulus = 2.0e4 - 0.25 * 101.3
    np.testing.assert_allclose(found.tau, modulus * found.gamma, atol=0.02)
    assert found.report.counters["plastic_updates"] == 0


def test_cycles_to_a_level(found: ShearCell) -> None:
    at = found.cycles_to(r_u=0.05)
    assert 0.0 < at < 0.75
    assert found.r_u[np.argmax(found.cycle >= at)] >= 0.05
    assert np.isnan(found.cycles_to(gamma_sa=0.04))
    with pytest.raises(sb.InvalidInput, match="exactly one"):
        found.cycles_to()


def test_progress_is_told() -> None:
    seen: list[tuple[float, int]] = []
    cell(spacing=0.01, size=0.2, max_cycles=0.25, progress=lambda gamma, steps: seen.append((gamma, steps)))
    assert [steps for _, steps in seen] == sorted(steps for _, steps in seen)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"soil": "sand"}, "soil = 'sand': must be a sandboil.PM4Sand"),
        ({"csr": 0.0}, "csr = 0.0: must be positive"),
        ({"csr": float("nan")}, "csr = nan: must be positive"),
        ({"sigma_v0": -100.0}, "sigma_v0 = -100.0: must be positive; kPa, compression positive"),
        ({"gamma_stop": 5.0}, r"gamma_stop = 5.0: must lie in \(0, 0.2\]; it is a fraction"),
        ({"max_cycles": True}, "max_cycles = True: must be positive"),
        ({"density": 0.0}, "density = 0.0: must be positive"),
        ({"void_ratio": -0.1}, "void_ratio = -0.1: must be positive"),
        ({"inertia": 2.0}, r"inertia = 2.0: must lie in \(0, 1\]"),
        ({"local_damping": 1.0}, r"local_damping = 1.0: must lie in \[0, 1\)"),
        ({"velocity_filter": -0.1}, "velocity_filter = -0.1: must not be negative"),
        ({"integrator": "euler"}, "integrator = 'euler': must be 'default'"),
        ({"threads": 0}, "threads = 0: must be a whole number"),
        ({"size": 0.29}, "size = 0.29: must be a multiple of spacing = 0.02; try 0.28"),
        ({"free_size": 0.02}, "free_size = 0.02: must be at least 2 spacings"),
        (
            {"size": 0.2},
            "size = 0.2: must exceed free_size by an even number of spacings, at least 10; try 0.28",
        ),
        ({"size": 0.3}, "size = 0.3: must exceed free_size by an even number"),
    ],
)
def test_bad_input_is_refused(changes: dict[str, Any], message: str) -> None:
    with pytest.raises(sb.InvalidInput, match=message):
        cell(**changes)
