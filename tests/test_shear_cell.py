"""The shear cell from Python: results, effect of options, and refused arguments."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import sandboil as sb
from sandboil import lab
from sandboil.lab import ShearCell, shear_cell

SAND = sb.PM4Sand(Dr=0.35, G0=476, hpo=0.53)


def cell(soil: Any = SAND, **changes: Any) -> ShearCell:
    """A short test with 4 by 4 free nodes and two turns."""
    arguments: dict[str, Any] = {"csr": 0.15, "max_cycles": 1, "spacing": 0.02, "size": 0.28}
    return shear_cell(soil, **(arguments | {"free_size": 0.08} | changes))


@pytest.fixture(scope="module")
def found() -> ShearCell:
    return cell()


def test_the_centre_reaches_the_prescribed_stress(found: ShearCell) -> None:
    target = 0.15 * 101.3
    turns = found.peaks()
    np.testing.assert_allclose(turns.tau, [target, -target], rtol=0.002)
    np.testing.assert_allclose(turns.cycle, [0.25, 0.75])
    assert 0.0 <= found.report.overshoot < 0.002
    # At constant volume, the tendency to contract reduces the effective stress.
    assert found.r_u[0] == pytest.approx(0.0, abs=1e-12)
    assert found.r_u[-1] > 0.1
    assert found.sigma_h_eff[0] == pytest.approx(0.5 * 101.3)
    np.testing.assert_allclose(found.void_ratio, SAND.initial_void_ratio, atol=1e-5)
    np.testing.assert_allclose(found.eps_v, 0.0, atol=1e-5)
    assert (found.complete, found.ended) == (True, "max_cycles = 1 was reached")


def test_the_result_has_the_interface_of_a_cyclic_test(found: ShearCell) -> None:
    """Columns, cycles and plots are those of `cyclic_dss`, so the two can be compared."""
    point = lab.cyclic_dss(SAND, csr=0.15, max_cycles=1)
    assert found.columns().keys() == point.columns().keys()
    assert found.cycles_to(r_u=0.05) == pytest.approx(point.cycles_to(r_u=0.05), abs=0.01)
    np.testing.assert_allclose(found.peaks().gamma, point.peaks().gamma, rtol=0.01)
    assert np.isnan(found.cycles_to(gamma_da=0.04))
    assert len(found.plot(point).axes) == 4
    assert len(found.to_dataframe()) == len(found.gamma)
    # Rows are recorded after enough change, not at each step.
    assert len(found.gamma) < found.report.steps / 2


def test_the_centre_stays_homogeneous_without_resets(found: ShearCell) -> None:
    report = found.report
    assert report.gamma_spread < 1e-4
    assert report.tau_spread < 0.2
    assert report.volume_strain < 1e-5


def test_fields_are_those_of_the_lattice(found: ShearCell) -> None:
    nodes = found.nodes
    assert nodes.position.shape == nodes.velocity.shape == (196, 2)
    assert nodes.free.sum() == 16
    held = nodes.position[~nodes.free]
    sheared = held[:, 0] - np.tile(np.arange(14) * 0.02 + 0.01, 14)[~nodes.free]
    # Eq. 17: displacement is proportional to the height above the centre of the block; no vertical motion.
    np.testing.assert_allclose(sheared, found.gamma[-1] * (held[:, 1] - 0.14), atol=1e-6)
    np.testing.assert_array_equal(nodes.velocity[~nodes.free][:, 1], 0.0)
    computed = ~np.isnan(nodes.tau)
    assert 2 * computed.sum() == found.report.computed_stress_nodes < found.report.stress_nodes == 392
    assert nodes.tau[nodes.free].mean() == pytest.approx(found.tau[-1])
    assert nodes.r_u[nodes.free].mean() == pytest.approx(found.r_u[-1])
    assert len(nodes.to_dataframe()) == 196


def assert_same_bits(one: ShearCell, other: ShearCell) -> None:
    free = one.nodes.free
    for ours, theirs in ((one.columns(), other.columns()), (one.nodes.columns(), other.nodes.columns())):
        for name, values in ours.items():
            # The soil at stress nodes that act on no free node is computed in one test and not in the other.
            kept = free if len(values) == len(free) else ...
            np.testing.assert_array_equal(values[kept], theirs[name][kept], err_msg=name, strict=True)


def test_soil_that_acts_on_no_free_node_changes_no_bit(found: ShearCell) -> None:
    all_nodes = cell(every_stress_node=True)
    assert_same_bits(found, all_nodes)
    assert all_nodes.report.computed_stress_nodes == 392
    updates = found.report.counters["plastic_updates"]
    assert updates == found.report.steps * found.report.computed_stress_nodes


@pytest.mark.parametrize("threads", [2, 3])
def test_threads_give_the_same_bits(threads: int) -> None:
    # A finer block, so that the loop over the soil is long enough for several threads.
    changes: dict[str, Any] = {"spacing": 0.01, "size": 0.2, "gamma_stop": 5e-4, "csr": 0.3}
    one, several = cell(**changes), cell(**changes, threads=threads)
    assert one.report.computed_stress_nodes >= 256
    assert_same_bits(one, several)


def test_elastic_soil_has_its_shear_modulus() -> None:
    found = cell(sb.Elastic(G=2.0e4, K=4.0e4))
    # Jaumann rate: rotation of the normal stresses changes the stiffness to G - (sigma_v - sigma_h)/2.
    modulus = 2.0e4 - 0.25 * 101.3
    np.testing.assert_allclose(found.tau, modulus * found.gamma, atol=0.02)
    assert found.report.counters["plastic_updates"] == 0
    assert np.isnan(found.void_ratio).all()


SOILS = [
    sb.PressureElastic(G=2.0e4, K=4.0e4, p_ref=100.0),
    sb.DruckerPrager(G=2.0e4, K=4.0e4, phi=30.0, c=5.0),
    sb.MohrCoulomb(G=2.0e4, K=4.0e4, phi=30.0, c=5.0),
    sb.TotalStress(G=2.0e4, K=9.0e4, Su=40.0),
]


@pytest.mark.parametrize("soil", SOILS, ids=lambda soil: soil.kind)
def test_any_material_gives_the_results_of_one_point(soil: sb.Material) -> None:
    found, point = cell(soil), lab.cyclic_dss(soil, csr=0.15, max_cycles=1)
    ours, theirs = found.peaks(), point.peaks()
    np.testing.assert_allclose(ours.gamma, theirs.gamma, rtol=0.01)
    np.testing.assert_allclose(ours.sigma_v_eff, theirs.sigma_v_eff, rtol=0.01)


def test_progress_is_reported() -> None:
    seen: list[tuple[float, float]] = []
    cell(spacing=0.01, size=0.2, progress=lambda cycle, gamma: seen.append((cycle, gamma)))
    assert [cycle for cycle, _ in seen] == sorted(cycle for cycle, _ in seen)
    assert 0.0 < seen[-1][0] < 0.75


REFUSED: list[tuple[str, dict[str, Any], str]] = [
    ("soil", {"soil": "sand"}, "must be an object of sandboil"),
    ("csr", {"csr": 0.0}, "must be greater than 0"),
    ("csr", {"csr": float("nan")}, "must be finite"),
    ("csr", {"csr": 3.0}, "must be at most .* the critical-state strength"),
    ("cssr", {"cssr": 0.1}, "unknown key, .*; did you mean 'csr'"),
    ("sigma_v0", {"sigma_v0": -100.0}, r"must lie in \(0, 100000\] .*compression positive"),
    ("K0", {"K0": 0.1}, r"must lie in \[0\.\d+, [34]\.\d+\]"),
    ("gamma_stop", {"gamma_stop": 5.0}, r"must lie in \(0, 0.2\] .*5 % is written 0.05"),
    ("max_cycles", {"max_cycles": 0.5}, "whole number"),
    ("density", {"density": 0.0}, "must be greater than 0 .*2000 kg/m3 is written 2.0"),
    ("void_ratio", {"void_ratio": 0.9}, r"must lie in \[0\.5, 0\.8\)"),
    ("strain_step", {"strain_step": 0.1}, r"must lie in \(0, 0.001\]"),
    ("inertia", {"inertia": 2.0}, r"must lie in \(0, 1\]"),
    ("local_damping", {"local_damping": 1.0}, r"must lie in \[0, 1\)"),
    ("velocity_filter", {"velocity_filter": -0.1}, "must be at least 0"),
    ("integrator", {"integrator": "euler"}, "must be one of 'default'"),
    ("tolerance", {"tolerance": 1e-5, "integrator": "rk4"}, "has no effect"),
    ("threads", {"threads": 0}, r"must lie in \[1, 256\]"),
    ("size", {"size": 0.29}, "must be a multiple of spacing = 0.02; try 0.28"),
    ("free_size", {"free_size": 0.02}, "must be at least 2 times the spacing"),
    ("size", {"size": 0.2}, "must exceed free_size by an even number of spacings, at least 10; try 0.28"),
    ("size", {"size": 0.3}, "must exceed free_size by an even number"),
]


@pytest.mark.parametrize(("name", "changes", "allowed"), REFUSED, ids=lambda value: str(value)[:40])
def test_an_invalid_argument_is_refused(name: str, changes: dict[str, Any], allowed: str) -> None:
    with pytest.raises(sb.InvalidInput, match=allowed) as caught:
        cell(**changes)
    assert caught.value.path == f"lab.shear_cell.{name}"


# Arguments at the limits of their range.
ENDS: list[dict[str, Any]] = [
    {"soil": sb.PM4Sand(Dr=0.05, G0=300.0, hpo=0.53), "csr": 0.05},
    {"K0": 2.0, "max_cycles": 1},
    {"sigma_v0": 2000.0},
    {"spacing": 0.01, "size": 0.2, "free_size": 0.02},
    {"strain_step": 1e-3},
    {"local_damping": 0.8},
    {"velocity_filter": 5.0},
    {"density": 200.0},
]


@pytest.mark.parametrize("changes", ENDS, ids=lambda changes: " ".join(changes))
def test_at_the_limits_of_the_range_results_are_those_of_one_point(changes: dict[str, Any]) -> None:
    found = cell(**({"max_cycles": 2} | changes))
    tested = {key: changes[key] for key in ("K0", "csr", "sigma_v0", "max_cycles") if key in changes}
    point = lab.cyclic_dss(changes.get("soil", SAND), **({"csr": 0.15, "max_cycles": 2} | tested))
    # The stress overshoots by about a thousandth; near liquefaction the effect of that on strain is much
    # larger.
    np.testing.assert_allclose(found.peaks().gamma, point.peaks().gamma, rtol=0.05)
    np.testing.assert_allclose(found.peaks().r_u, point.peaks().r_u, atol=0.01)
    assert found.report.gamma_spread < 0.02 * found.gamma_sa.max()


def test_a_stress_above_the_strength_ends_at_the_strain_limit() -> None:
    found = cell(csr=1.4, gamma_stop=0.02)
    assert found.complete
    assert found.ended == "the shear strain reached gamma_stop = 0.02 before the first turn"
    assert found.report.overshoot < 0.0
