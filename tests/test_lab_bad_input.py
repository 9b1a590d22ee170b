"""Ranges in error messages of the laboratory end where the soil fails; other errors are in `bad_inputs`."""

from __future__ import annotations

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


LATERAL = sb.TotalStress(Su=30.0, G=1e4, K=1e5)
FRICTION = {"phi": 30.0, "G": 5e4, "K": 1e5}


@pytest.mark.parametrize(
    ("soil", "name", "arguments", "allowed"),
    [
        # (1 - K0)/2 sigma_v0 = Su; Rankine's coefficients; pure shear on the cone.
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
def test_an_initial_stress_beyond_the_strength_is_refused_with_its_range(
    soil: object, name: str, arguments: dict[str, float], allowed: list[float]
) -> None:
    """The core would replace the stress by an admissible one, which is another test than the given one."""
    with pytest.raises(InvalidInput) as refused:
        lab.monotonic_dss(soil, gamma_max=0.01, **arguments)
    assert refused.value.path == f"lab.monotonic_dss.{name}"
    found = [float(end) for end in re.findall(r"-?\d+\.\d+", refused.value.allowed)[:2]]
    assert found == pytest.approx(allowed, abs=1e-3)


def test_an_initial_stress_beyond_the_strength_is_refused_with_the_share_that_is_carried() -> None:
    soil = sb.MohrCoulomb(c=0.0, **FRICTION)
    with pytest.raises(InvalidInput, match=r"can carry 0\.\d+ times the deviator") as refused:
        lab.strain_path(soil, stress0=(-1.0, -100.0, 0.0), strain=[(0.0, 0.0, 1e-3)])
    share = float(re.findall(r"0\.\d+", refused.value.allowed)[0])
    # sin(phi) = 0.5, and the circle has its centre at 50.5 and the radius 49.5.
    assert share == pytest.approx(0.5 * 50.5 / 49.5, abs=2e-3)


def test_numbers_of_numpy_are_accepted() -> None:
    test = lab.cyclic_dss(SAND, csr=np.float32(0.1), max_cycles=np.int64(1), sigma_v0=np.array(100.0))
    assert test.turns[-1] == 2


def test_the_allowed_range_of_k0_is_exact() -> None:
    message = refusal(lab.cyclic_dss, csr=0.1, K0=0.05)
    least, most = (float(end) for end in re.findall(r"\d+\.\d+", message.allowed))
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
def test_any_argument_gives_a_finite_result_or_is_refused(arguments: dict[str, Any]) -> None:
    try:
        test = lab.cyclic_dss(SAND, **({"csr": 0.1, "max_cycles": 1, "gamma_stop": 0.001} | arguments))
    except InvalidInput:
        return
    assert np.isfinite(test.tau).all()
    assert np.isfinite(test.sigma_v_eff).all()
