"""Each slip in a test's arguments is refused with its path, the value, what is allowed, and the remedy."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
import sandboil as sb
from hypothesis import given, settings
from hypothesis import strategies as st
from sandboil import InvalidInput, lab

SAND = sb.PM4Sand(Dr=0.55, G0=677.0, hpo=0.40)
# A soil whose critical state at constant volume is weak: 0.3 kPa at D_r 0.13.
LOOSE = sb.PM4Sand(Dr=0.13, G0=300.0, hpo=0.5)
STRESS = (-50.0, -100.0, 0.0)


def refusal(test: Callable[..., object], **arguments: Any) -> InvalidInput:
    soil = arguments.pop("soil", SAND)
    with pytest.raises(InvalidInput) as caught:
        test(soil, **arguments)
    return caught.value


CYCLIC: list[tuple[str, dict[str, Any], str]] = [
    ("csr", {"csr": 0.0}, "must be greater than 0"),
    ("csr", {"csr": -0.1}, "must be greater than 0"),
    ("csr", {"csr": math.nan}, "must be finite"),
    ("csr", {"csr": "0.1"}, "must be a number"),
    ("csr", {"csr": 2.0, "drained": True}, "must turn within .* bounding stress ratio"),
    ("csr", {"csr": 30.0}, "must turn within .* critical-state strength"),
    ("csr", {"csr": 0.9, "soil": LOOSE}, "must turn within .* critical-state strength"),
    ("cccsr", {"cccsr": 0.1}, "unknown key, known are soil, .*; did you mean 'csr'"),
    ("sigma_v", {"csr": 0.1, "sigma_v": 100.0}, "unknown key, .*; did you mean 'sigma_v0'"),
    ("gamma_stopp", {"csr": 0.1, "gamma_stopp": 0.1}, "unknown key, .*; did you mean 'gamma_stop'"),
    ("sigma_v0", {"csr": 0.1, "sigma_v0": -100.0}, r"must lie in \(0, 100000\] .*compression positive"),
    ("sigma_v0", {"csr": 0.1, "sigma_v0": 0.2}, r"must be at least 0\.5\d* kPa"),
    ("K0", {"csr": 0.1, "K0": 0.0}, r"must lie in \(0, 100\]"),
    ("K0", {"csr": 0.1, "K0": 0.1}, r"must lie in \[0\.\d+, [34]\.\d+\]"),
    ("K0", {"csr": 0.1, "K0": 9.0}, r"must lie in \[0\.\d+, [34]\.\d+\]"),
    ("static_shear_ratio", {"csr": 0.1, "static_shear_ratio": 0.8}, r"must lie in \[-0\.4\d*, 0\.4\d*\]"),
    ("static_shear_ratio", {"csr": 0.1, "static_shear_ratio": -0.8}, r"must lie in \[-0\.4\d*, 0\.4\d*\]"),
    ("void_ratio", {"csr": 0.1, "void_ratio": 0.9}, r"must lie in \[0\.5, 0\.8\)"),
    ("void_ratio", {"csr": 0.1, "void_ratio": 0.0}, "must be greater than 0"),
    ("gamma_stop", {"csr": 0.1, "gamma_stop": 0.0}, r"must lie in \(0, 1\]"),
    ("gamma_stop", {"csr": 0.1, "gamma_stop": 5.0}, "5 % is written 0.05"),
    ("max_cycles", {"csr": 0.1, "max_cycles": 0}, r"must lie in \[1, 1e\+07\]"),
    ("max_cycles", {"csr": 0.1, "max_cycles": 2.5}, "whole number"),
    ("drained", {"csr": 0.1, "drained": "no"}, "boolean"),
    ("integrator", {"csr": 0.1, "integrator": "rk44"}, "'default', 'rk4', 'reference'; did you mean 'rk4'"),
    ("tolerance", {"csr": 0.1, "tolerance": 0.1}, r"must lie in \(0, 0.0001\]"),
    ("tolerance", {"csr": 0.1, "tolerance": 1e-5, "integrator": "rk4"}, "has no effect"),
    ("reversals", {"reversals": []}, "n at least 1"),
    ("reversals", {"reversals": [[0.1, -0.1]]}, r"must have shape \(n,\)"),
    ("void_ratio", {"csr": 0.1, "void_ratio": 0.45}, r"must lie in \[0.5, 0.8\)"),
    ("reversals", {"reversals": [0.1, math.inf]}, "must be finite throughout"),
    ("reversals", {"reversals": ["up", "down"]}, "must be numbers"),
    ("reversals", {"reversals": [0.1, -30.0]}, "must turn within"),
    ("reversals[1]", {"reversals": [0.1, 0.2]}, "must turn back"),
    ("reversals[2]", {"reversals": [0.1, -0.1, -0.1]}, "must turn back"),
    ("reversals[0]", {"reversals": [0.1], "static_shear_ratio": 0.1}, "must turn back"),
    (
        "gamma_reversals",
        {"gamma_reversals": [0.01, -0.2]},
        "must lie within gamma_stop = 0.05; give a larger",
    ),
    ("gamma_reversals[0]", {"gamma_reversals": [0.0, 0.01]}, "must turn back"),
    ("soil", {"soil": "sand", "csr": 0.1}, "must be a material .*SoilModel"),
    ("soil", {"soil": sb.PM4Sand, "csr": 0.1}, "must be a material"),
    ("soil", {"soil": object(), "csr": 0.1}, "the methods initialise, update, stress and moduli"),
]


@pytest.mark.parametrize(("name", "arguments", "allowed"), CYCLIC, ids=lambda value: str(value)[:40])
def test_a_slip_in_cyclic_shear_is_refused(name: str, arguments: dict[str, Any], allowed: str) -> None:
    told = refusal(lab.cyclic_dss, **arguments)
    assert told.path == f"lab.cyclic_dss.{name}"
    assert re.search(allowed, f"{told.allowed}; {told.hint}"), str(told)


def test_exactly_one_loading_must_be_given() -> None:
    for arguments in ({}, {"csr": 0.1, "reversals": [0.1]}, {"csr": 0.1, "gamma_reversals": [0.1]}):
        told = refusal(lab.cyclic_dss, **arguments)
        assert told.path == "lab.cyclic_dss"
        assert "exactly one of csr, reversals, gamma_reversals" in told.allowed


OTHERS: list[tuple[Callable[..., object], str, dict[str, Any], str]] = [
    (lab.monotonic_dss, "gamma_max", {"gamma_max": -0.1}, r"must lie in \(0, 1\]"),
    (lab.monotonic_dss, "gamma_mx", {"gamma_mx": 0.1}, "did you mean 'gamma_max'"),
    (lab.monotonic_dss, "K0", {"K0": 0.05}, "this soil fails before the test begins"),
    (lab.strain_path, "strain", {"stress0": STRESS}, "is required"),
    (lab.strain_path, "strain", {"stress0": STRESS, "strain": []}, r"must have shape \(n, 3\)"),
    (lab.strain_path, "strain", {"stress0": STRESS, "strain": [(0.0, 0.1)]}, r"shape \(n, 3\), not \(1, 2\)"),
    (lab.strain_path, "strain", {"stress0": STRESS, "strain": [(0.0, 0.0, 5.0)]}, "5 % is written 0.05"),
    (lab.strain_path, "strain", {"stress0": STRESS, "strain": [(0.0, 0.0, math.nan)]}, "must be finite"),
    (lab.strain_path, "stress0", {"stress0": (1.0, 2.0), "strain": [(0, 0, 0.1)]}, "3 or 4 components"),
    (lab.strain_path, "stress0", {"stress0": (50, 100, 0), "strain": [(0, 0, 0.1)]}, "has a minus sign"),
    (lab.strain_path, "stress0", {"stress0": (-9, -100, 0), "strain": [(0, 0, 0.1)]}, "carries no more"),
    (lab.stress_path, "stress", {"stress0": STRESS, "stress": [1.0, 2.0, 3.0]}, r"must have shape \(n, 3\)"),
    (lab.stress_path, "stress", {"stress0": STRESS, "stress": [(0.0, 0.0, 1e9)]}, "stresses are in kPa"),
    (lab.strain_path, "stress0", {"stress0": (-1e9, -1.0, 0.0), "strain": [(0, 0, 0.1)]}, "are in kPa"),
    (lab.plane_strain_compression, "axial_strain_max", {"axial_strain_max": 1.0}, r"must lie in \(0, 1\)"),
    (lab.plane_strain_compression, "K0", {"K0": 30.0}, "must lie in"),
    (lab.modulus_reduction, "strains", {"strains": [0.0, 1e-3]}, r"must lie in \(0, 1\]"),
    (lab.modulus_reduction, "cycles", {"cycles": 0}, r"must lie in \[1, 1e\+07\]"),
    (lab.modulus_reduction, "strain", {"strain": [1e-3]}, "did you mean 'strains'"),
]


@pytest.mark.parametrize(("test", "name", "arguments", "allowed"), OTHERS)
def test_a_slip_in_another_test_is_refused(
    test: Callable[..., object], name: str, arguments: dict[str, Any], allowed: str
) -> None:
    told = refusal(test, **arguments)
    assert told.path == f"lab.{test.__name__}.{name}"
    assert re.search(allowed, f"{told.allowed}; {told.hint}"), str(told)


LATERAL = sb.TotalStress(Su=30.0, G=1e4, K=1e5)
FRICTION = {"phi": 30.0, "G": 5e4, "K": 1e5}


@pytest.mark.parametrize(
    ("soil", "name", "arguments", "allowed"),
    [
        # (1 - K0)/2 sigma_v0 is Su; Rankine's coefficients; shear alone on the cone.
        (LATERAL, "K0", {"K0": 0.05}, [1.0 - 60.0 / 101.3, 1.0 + 60.0 / 101.3]),
        (sb.MohrCoulomb(c=0.0, **FRICTION), "K0", {"K0": 0.1}, [1.0 / 3.0, 3.0]),
        (
            sb.DruckerPrager(c=0.0, psi=30.0, **FRICTION),
            "static_shear_ratio",
            {"static_shear_ratio": 0.9, "K0": 1.0},
            [-0.4804, 0.4804],  # 3 tan(phi)/sqrt(9 + 12 tan^2(phi))
        ),
    ],
)
def test_a_start_beyond_the_strength_of_any_soil_is_refused(
    soil: object, name: str, arguments: dict[str, float], allowed: list[float]
) -> None:
    """The core would replace it by a stress inside, and the test would not be the one that was asked for."""
    with pytest.raises(InvalidInput) as told:
        lab.monotonic_dss(soil, gamma_max=0.01, **arguments)
    assert told.value.path == f"lab.monotonic_dss.{name}"
    range_told = [float(end) for end in re.findall(r"-?\d+\.\d+", told.value.allowed)[:2]]
    assert range_told == pytest.approx(allowed, abs=1e-3)


def test_a_first_stress_beyond_the_strength_is_told_with_the_share_that_is_carried() -> None:
    soil = sb.MohrCoulomb(c=0.0, **FRICTION)
    with pytest.raises(InvalidInput, match=r"must be 0\.\d+ times that far from isotropic") as told:
        lab.strain_path(soil, stress0=(-1.0, -100.0, 0.0), strain=[(0.0, 0.0, 1e-3)])
    share = float(re.findall(r"0\.\d+", told.value.allowed)[0])
    # sin(phi) of the circle with the centre 50.5 and the radius 49.5.
    assert share == pytest.approx(0.5 * 50.5 / 49.5, abs=2e-3)


def test_numbers_of_numpy_are_numbers() -> None:
    test = lab.cyclic_dss(SAND, csr=np.float32(0.1), max_cycles=np.int64(1), sigma_v0=np.array(100.0))
    assert test.turns[-1] == 2
    for name, wrong in (("csr", np.array([0.1])), ("max_cycles", 10**20), ("max_cycles", True)):
        told = refusal(lab.cyclic_dss, **({"csr": 0.1} | {name: wrong}))
        assert told.path == f"lab.cyclic_dss.{name}"


def test_only_a_test_with_its_specimen_goes_on() -> None:
    test = lab.cyclic_dss(SAND, csr=0.1, max_cycles=1)
    for wrong in (None, 3.0, test.peaks()):
        with pytest.raises(InvalidInput, match=r"lab\.reconsolidation\.test"):
            lab.reconsolidation(wrong)


def test_the_allowed_k0_that_is_told_is_the_edge() -> None:
    told = refusal(lab.cyclic_dss, csr=0.1, K0=0.05)
    least, most = (float(end) for end in re.findall(r"\d+\.\d+", told.allowed))
    for inside, outside in ((least + 1e-3, least - 1e-3), (most - 2e-3, most + 2e-3)):
        lab.cyclic_dss(SAND, csr=0.01, K0=inside, max_cycles=1)
        refusal(lab.cyclic_dss, csr=0.01, K0=outside)


ANYTHING = st.one_of(st.none(), st.floats(), st.text(max_size=3), st.lists(st.floats(), max_size=3))


@settings(max_examples=150, deadline=None)
@given(
    st.dictionaries(
        st.sampled_from(["csr", "sigma_v0", "K0", "static_shear_ratio", "void_ratio", "gamma_stop", "x"]),
        ANYTHING,
        max_size=3,
    )
)
def test_whatever_is_given_is_tested_or_refused(arguments: dict[str, Any]) -> None:
    """Never another error, and never a result that is not finite."""
    try:
        test = lab.cyclic_dss(SAND, **({"csr": 0.1, "max_cycles": 1, "gamma_stop": 0.001} | arguments))
    except InvalidInput:
        return
    assert np.isfinite(test.tau).all()
    assert np.isfinite(test.sigma_v_eff).all()
