"""The laboratory: conventions, numbers of cycles, and results against elasticity and definitions."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
import sandboil as sb
from hypothesis import given, settings
from hypothesis import strategies as st
from matplotlib.figure import Figure
from sandboil import InvalidInput, lab

SAND = sb.PM4Sand(Dr=0.55, G0=677.0, hpo=0.40)
ROCK = sb.Elastic(G=3.0e4, K=9.0e4)
SIGMA = 101.3
INTEGRATORS = ("default", "rk4", "reference")


class Hooke:
    """The material ROCK as a model written by a user."""

    def initialise(self, stress: tuple[float, ...], void_ratio: float | None) -> tuple[float, ...]:
        return stress

    def update(
        self, state: tuple[float, float, float, float], strain: tuple[float, float, float]
    ) -> tuple[float, ...]:
        (xx, yy, xy, zz), (exx, eyy, gxy) = state, strain
        p, g = (9.0e4 - 2.0e4) * (exx + eyy), 3.0e4
        return xx + p + 2.0 * g * exx, yy + p + 2.0 * g * eyy, xy + g * gxy, zz + p

    def stress(self, state: Any) -> Any:
        return state

    def moduli(self, state: Any) -> tuple[float, float]:
        return 3.0e4, 9.0e4


@pytest.fixture(scope="module")
def cyclic() -> lab.CyclicTest:
    return lab.cyclic_dss(SAND, csr=0.147)


# Cyclic direct simple shear


def test_a_test_begins_at_the_given_stress() -> None:
    test = lab.cyclic_dss(SAND, sigma_v0=80.0, K0=0.6, csr=0.1, static_shear_ratio=0.05, max_cycles=1)
    first = {name: column[0] for name, column in test.columns().items()}
    assert first == pytest.approx(
        {
            "gamma": 0.0,
            "tau": 4.0,
            "sigma_v_eff": 80.0,
            "sigma_h_eff": 48.0,
            "r_u": 0.0,
            "eps_v": 0.0,
            "cycle": 0.0,
            "turns": 0,
            "void_ratio": SAND.initial_void_ratio,
        },
        abs=1e-12,
    )


def test_uniform_shear_turns_about_the_static_stress() -> None:
    test = lab.cyclic_dss(SAND, csr=0.1, static_shear_ratio=0.04, max_cycles=3)
    assert (test.complete, test.ended) == (True, "max_cycles = 3 was reached")
    peaks = test.peaks()
    np.testing.assert_allclose(peaks.tau / SIGMA, [0.14, -0.06] * 3, rtol=1e-6)
    np.testing.assert_allclose(peaks.cycle, np.arange(0.25, 3.0, 0.5))
    np.testing.assert_array_equal(peaks.turns, np.arange(1, 7))


def test_undrained_shear_keeps_the_volume_and_drained_shear_the_vertical_stress() -> None:
    undrained = lab.cyclic_dss(SAND, csr=0.1, max_cycles=3)
    drained = lab.cyclic_dss(SAND, csr=0.1, max_cycles=3, drained=True)
    assert not undrained.eps_v.any()
    assert undrained.r_u[-1] > 0.1
    np.testing.assert_allclose(drained.sigma_v_eff, SIGMA, rtol=1e-5)
    assert drained.eps_v[-1] > 1e-5
    change = drained.void_ratio[0] - drained.void_ratio
    np.testing.assert_allclose(change, (1.0 + drained.void_ratio[0]) * drained.eps_v, rtol=1e-6, atol=1e-12)


def test_irregular_shear_turns_at_the_given_stresses() -> None:
    turning = [0.05, -0.07, 0.13, 0.1, 0.12]
    test = lab.cyclic_dss(SAND, reversals=turning)
    np.testing.assert_allclose(test.peaks().tau, SIGMA * np.array(turning), rtol=1e-6)
    assert test.ended == "all reversals were reached"


@pytest.mark.parametrize("drained", [True, False])
def test_strain_controlled_shear_turns_at_the_given_strains(drained: bool) -> None:
    test = lab.cyclic_dss(SAND, gamma_reversals=np.array([0.002, -0.002, 0.004]), drained=drained)
    np.testing.assert_allclose(test.peaks().gamma, [0.002, -0.002, 0.004], rtol=1e-12)


def test_shear_ends_at_its_strain_limit(cyclic: lab.CyclicTest) -> None:
    assert cyclic.complete
    assert cyclic.ended == "the shear strain reached gamma_stop = 0.05"
    assert np.abs(cyclic.gamma).max() == pytest.approx(0.05, abs=2e-5)


def test_a_csr_above_the_drained_strength_ends_at_the_strain_limit() -> None:
    """The CSR is below the bounding stress ratio, so it is not refused, but the sand cannot carry it."""
    test = lab.cyclic_dss(SAND, csr=0.7, drained=True)
    assert test.ended == "the shear strain reached gamma_stop = 0.05 before the first turn"
    assert math.isnan(test.cycles_to(gamma_da=0.01))


def test_denser_sand_needs_more_cycles() -> None:
    cycles = [
        lab.cyclic_dss(SAND, csr=0.147, void_ratio=e).cycles_to(gamma_sa=0.03) for e in (0.66, 0.635, 0.61)
    ]
    assert cycles[0] < cycles[1] < cycles[2]


@pytest.mark.parametrize("integrator", INTEGRATORS)
def test_every_integrator_gives_the_same_number_of_cycles(integrator: Any, cyclic: lab.CyclicTest) -> None:
    other = lab.cyclic_dss(SAND, csr=0.147, integrator=integrator)
    assert other.cycles_to(r_u=0.95) == pytest.approx(cyclic.cycles_to(r_u=0.95), abs=0.03)


def test_the_largest_tolerance_gives_nearly_the_same_cycles(cyclic: lab.CyclicTest) -> None:
    coarse = lab.cyclic_dss(SAND, csr=0.147, tolerance=1.0e-4)
    assert coarse.cycles_to(gamma_sa=0.03) == pytest.approx(cyclic.cycles_to(gamma_sa=0.03), abs=0.03)


# Numbers of cycles


def by_hand(turns: list[float], r_u: list[float]) -> lab.CyclicTest:
    """A test with strain linear between turns, five rows for each leg, and the given r_u at each turn."""
    gamma, cycle, made = [0.0], [0.0], [0]
    for k, turn in enumerate(turns):
        begin = gamma[-1]
        gamma += [begin + share * (turn - begin) for share in (0.2, 0.4, 0.6, 0.8, 1.0)]
        span = 0.25 if k == 0 else 0.5
        cycle += [cycle[-1] + share * span for share in (0.2, 0.4, 0.6, 0.8, 1.0)]
        made += [k, k, k, k, k + 1]
    pressure = np.interp(cycle, [0.0, *(0.25 + 0.5 * k for k in range(len(turns)))], [0.0, *r_u])
    nothing = np.zeros(len(gamma))
    return lab.CyclicTest(
        gamma=np.array(gamma),
        tau=nothing,
        sigma_v_eff=100.0 * (1.0 - pressure),
        sigma_h_eff=nothing,
        eps_v=nothing,
        void_ratio=nothing,
        sigma_v0=100.0,
        drained=False,
        cycle=np.array(cycle),
        turns=np.array(made),
        complete=True,
        ended="",
    )


def test_cycles_agree_with_their_definition() -> None:
    test = by_hand([0.01, -0.02, 0.04], [0.2, 0.6, 0.9])
    assert test.cycles_to(r_u=0.4) == pytest.approx(0.5)
    assert test.cycles_to(gamma_sa=0.01) == pytest.approx(0.25)
    # From 0.01 to -0.02 the change since the start is 0.015 at five sixths of the stroke.
    assert test.cycles_to(gamma_sa=0.015) == pytest.approx(0.25 + 0.5 * 5.0 / 6.0)
    # The double amplitude is the change since the last turn; before the first turn there is none.
    assert test.cycles_to(gamma_da=0.005) == pytest.approx(0.25 + 0.5 / 6.0)
    assert test.cycles_to(gamma_da=0.03) == pytest.approx(0.75)
    assert test.cycles_to(gamma_da=0.06) == pytest.approx(1.25)
    assert math.isnan(test.cycles_to(gamma_da=0.0601))
    assert math.isnan(test.cycles_to(r_u=0.95))
    np.testing.assert_allclose(test.peaks().gamma_sa, [0.01, 0.02, 0.04])


@settings(max_examples=50, deadline=None)
@given(
    st.lists(st.floats(0.001, 0.1), min_size=1, max_size=8),
    st.floats(0.001, 0.1),
    st.floats(0.001, 0.1),
)
def test_a_higher_level_is_never_reached_earlier(amplitudes: list[float], one: float, two: float) -> None:
    turns = [amplitude * (-1.0) ** k for k, amplitude in enumerate(amplitudes)]
    test = by_hand(turns, [0.1 * (k + 1) for k in range(len(turns))])
    low, high = sorted((one, two))
    for measure in ("gamma_sa", "gamma_da", "r_u"):
        first, second = (test.cycles_to(**{measure: level}) for level in (low, high))
        assert math.isnan(second) or first <= second
        assert math.isnan(first) or 0.0 <= first <= test.cycle[-1]


def test_cycles_to_no_measure_or_to_two_are_refused(cyclic: lab.CyclicTest) -> None:
    for measures in ({}, {"r_u": 0.9, "gamma_sa": 0.03}):
        with pytest.raises(InvalidInput, match="exactly one measure of r_u, gamma_sa, gamma_da"):
            cyclic.cycles_to(**measures)
    with pytest.raises(InvalidInput, match=r"cycles_to\.r_u = -1\.0: must be greater than 0"):
        cyclic.cycles_to(r_u=-1.0)


# Other tests


@pytest.mark.parametrize("drained", [True, False])
def test_monotonic_shear_reaches_the_given_strain(drained: bool) -> None:
    test = lab.monotonic_dss(SAND, drained=drained, gamma_max=0.02)
    assert test.complete
    assert test.gamma[-1] == pytest.approx(0.02, rel=1e-12)
    assert (np.diff(test.gamma) > 0.0).all()


def test_a_path_has_one_row_for_each_given_row() -> None:
    strain = np.array([[0.0, 0.0, 0.0], [1e-4, -2e-4, 3e-4], [0.0, -1e-4, -1e-4]])
    test = lab.strain_path(ROCK, stress0=(-50.0, -100.0, 0.0), strain=strain)
    assert (test.complete, test.ended) == (True, "the end of the path was reached")
    lame, g = 9.0e4 - 2.0e4, 3.0e4
    pressure = lame * (strain[:, 0] + strain[:, 1])
    expected = np.column_stack(
        [
            -50.0 + pressure + 2.0 * g * strain[:, 0],
            -100.0 + pressure + 2.0 * g * strain[:, 1],
            g * strain[:, 2],
        ]
    )
    np.testing.assert_allclose(test.stress, expected, rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(test.stress_zz, -50.0 + pressure, rtol=1e-9)
    np.testing.assert_array_equal(test.strain, strain)
    back = lab.stress_path(ROCK, stress0=(-50.0, -100.0, 0.0), stress=test.stress)
    np.testing.assert_allclose(back.strain, strain, atol=1e-9)


def test_a_path_is_incomplete_if_the_sand_cannot_carry_a_stress() -> None:
    test = lab.stress_path(SAND, stress0=(-50.0, -100.0, 0.0), stress=[(-50, -100, 20), (-50, -100, 90)])
    assert not test.complete
    assert test.ended.startswith("in leg 2 of 2: the soil does not carry")
    assert len(test.stress) == 2
    assert 20.0 < test.stress[-1, 2] < 90.0


def test_plane_strain_compression_keeps_the_lateral_stress_or_the_volume() -> None:
    drained = lab.plane_strain_compression(SAND, drained=True)
    undrained = lab.plane_strain_compression(SAND, axial_strain_max=0.05)
    assert drained.complete
    assert undrained.complete
    np.testing.assert_allclose(drained.sigma_h_eff, SIGMA, rtol=1e-5)
    np.testing.assert_allclose(undrained.eps_v, 0.0, atol=1e-12)
    assert drained.axial_strain[-1] == pytest.approx(0.1)
    # Medium dense sand contracts, then dilates, and has a peak strength.
    assert drained.eps_v.max() > 0.0 > drained.eps_v[-1]
    assert drained.q.max() > drained.q[-1] > 2.0 * SIGMA
    np.testing.assert_allclose(undrained.excess_pore_pressure, SIGMA - undrained.sigma_h_eff, rtol=1e-12)


def test_liquefied_sand_settles_more_with_its_post_shaking_stiffness(cyclic: lab.CyclicTest) -> None:
    """About 1 % contraction at D_r 0.55 after 5 % shear strain; without the factor less than half of it."""
    before = cyclic.specimen
    assert before is not None
    stress = before.stress
    soft = lab.reconsolidation(cyclic)
    stiff = lab.reconsolidation(cyclic, post_shaking=False)
    assert before.stress == stress, "the specimen of the test must not change"
    for test in (soft, stiff):
        assert test.complete
        assert test.sigma_v_eff[-1] == pytest.approx(SIGMA, rel=1e-6)
        assert test.sigma_v_eff[0] < 0.05 * SIGMA
        np.testing.assert_allclose(test.tau, 0.0, atol=1e-4)
    assert 0.005 < soft.eps_v[-1] < 0.02
    assert stiff.eps_v[-1] < 0.5 * soft.eps_v[-1]


def test_reconsolidation_keeps_a_static_shear_stress() -> None:
    test = lab.cyclic_dss(SAND, csr=0.12, static_shear_ratio=0.05)
    settled = lab.reconsolidation(test)
    np.testing.assert_allclose(settled.tau, 0.05 * SIGMA, rtol=1e-4)


def test_elastic_soil_has_constant_modulus_and_no_damping() -> None:
    test = lab.modulus_reduction(ROCK, strains=[1e-6, 1e-4, 1e-2])
    assert test.complete
    np.testing.assert_allclose(test.G, 3.0e4, rtol=1e-9)
    np.testing.assert_allclose(test.G_ratio, 1.0, rtol=1e-9)
    np.testing.assert_allclose(test.damping, 0.0, atol=1e-9)


@pytest.mark.parametrize("integrator", INTEGRATORS)
def test_modulus_of_sand_decreases_and_damping_increases_with_strain(integrator: Any) -> None:
    test = lab.modulus_reduction(SAND, integrator=integrator)
    assert test.complete
    assert test.G_ratio[0] == pytest.approx(1.0, abs=1e-3)
    assert (np.diff(test.G) < 0.0).all()
    assert test.damping[0] == pytest.approx(0.0, abs=1e-6)
    assert (np.diff(test.damping) > -1e-6).all()


# Models written by the user


def test_a_model_in_python_gives_the_results_of_the_built_in_one() -> None:
    for test in (lab.cyclic_dss, lab.monotonic_dss):
        for drained in (False, True):
            extra = {"csr": 0.2, "max_cycles": 3} if test is lab.cyclic_dss else {"gamma_max": 0.01}
            ours, theirs = (
                test(soil, K0=0.6, drained=drained, **extra).columns() for soil in (ROCK, Hooke())
            )
            for name in ours:
                np.testing.assert_allclose(theirs[name], ours[name], rtol=1e-9, atol=1e-9, err_msg=name)


def test_an_exception_of_a_model_is_raised_to_the_caller() -> None:
    class Broken(Hooke):
        def update(self, state: Any, strain: Any) -> Any:
            raise ZeroDivisionError("division by zero in the model")

    with pytest.raises(ZeroDivisionError, match="division by zero in the model"):
        lab.monotonic_dss(Broken())


def test_a_modulus_that_is_not_finite_is_refused() -> None:
    class NotFinite(Hooke):
        def moduli(self, state: Any) -> tuple[float, float]:
            return math.nan, 1.0

    with pytest.raises(ValueError, match="must be finite"):
        lab.monotonic_dss(NotFinite())


# Tables and plots


def test_results_convert_to_a_dataframe(cyclic: lab.CyclicTest) -> None:
    frame = cyclic.to_dataframe()
    assert set(frame.columns) == {
        *("gamma", "tau", "sigma_v_eff", "sigma_h_eff", "eps_v", "void_ratio", "cycle", "turns", "r_u")
    }
    np.testing.assert_array_equal(frame["r_u"], cyclic.r_u)
    path = lab.strain_path(ROCK, stress0=(-50.0, -100.0, 0.0), strain=[(0, 0, 1e-4)]).to_dataframe()
    assert list(path.columns) == [
        *("eps_xx", "eps_yy", "gamma_xy", "sig_xx", "sig_yy", "tau_xy", "sig_zz", "void_ratio")
    ]
    assert "q" in lab.plane_strain_compression(ROCK, axial_strain_max=1e-4).to_dataframe()
    assert "G_ratio" in lab.modulus_reduction(ROCK, strains=[1e-4]).to_dataframe()


def test_without_pandas_the_error_says_how_to_install_it(
    cyclic: lab.CyclicTest, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(__import__("sys").modules, "pandas", None)
    with pytest.raises(ImportError, match=r"pip install 'sandboil\[studies\]'"):
        cyclic.to_dataframe()


def labels(figure: Figure) -> list[tuple[str, str]]:
    figure.canvas.draw()
    return [(axes.get_xlabel(), axes.get_ylabel()) for axes in figure.axes]


def test_plots_show_the_test_and_the_reference(cyclic: lab.CyclicTest) -> None:
    other = lab.cyclic_dss(SAND, csr=0.16)
    for reference in (other, other.columns()):
        figure = cyclic.plot(reference=reference)
        assert [y for _, y in labels(figure)] == [
            *("shear stress, kPa", "shear stress, kPa", "excess pore pressure ratio, 1", "shear strain, %")
        ]
        ours, theirs = figure.axes[0].get_lines()
        np.testing.assert_array_equal(ours.get_xdata(), cyclic.sigma_v_eff)
        np.testing.assert_array_equal(theirs.get_xdata(), other.sigma_v_eff)
    drained = lab.cyclic_dss(SAND, csr=0.1, max_cycles=2, drained=True)
    assert labels(drained.plot())[2] == ("cycles, 1", "contraction, %")
    assert len(labels(lab.monotonic_dss(SAND, gamma_max=0.01).plot())) == 3
    compressed = lab.plane_strain_compression(SAND, axial_strain_max=0.01)
    assert labels(compressed.plot(reference=compressed))[2][1] == "excess pore pressure, kPa"
    assert labels(lab.reconsolidation(cyclic).plot())[0][0] == "contraction, %"
    path = lab.strain_path(SAND, stress0=(-50, -100, 0), strain=[(0, 0, 1e-3), (0, 0, 0)])
    assert labels(path.plot(reference=path))[0] == ("shear strain xy, %", "shear stress xy, kPa")
    curve = lab.modulus_reduction(SAND, strains=[1e-5, 1e-4])
    assert [y for _, y in labels(curve.plot(reference=curve))] == ["$G/G_{max}$, 1", "damping ratio, %"]


def test_a_reference_without_a_column_is_refused(cyclic: lab.CyclicTest) -> None:
    with pytest.raises(InvalidInput, match="must have the array sigma_v_eff as attribute or key"):
        cyclic.plot(reference={"gamma": [0.0]})


def test_the_arrays_of_a_compression_test_agree_with_their_definitions():
    test = lab.plane_strain_compression(SAND, sigma_v0=100.0, K0=0.6, axial_strain_max=0.02)
    assert test.excess_pore_pressure[0] == 0.0
    assert test.p[0] == pytest.approx(80.0)
    assert test.q[0] == pytest.approx(40.0)
    assert test.p == pytest.approx(0.5 * (test.sigma_v_eff + test.sigma_h_eff))
    assert test.excess_pore_pressure == pytest.approx(60.0 - test.sigma_h_eff)


def test_peaks_keep_the_pore_pressure_ratio_of_the_test():
    test = lab.cyclic_dss(SAND, csr=0.2, max_cycles=2)
    at_turn = np.flatnonzero(np.diff(test.turns, prepend=0))
    assert (test.peaks().r_u == test.r_u[at_turn]).all()


def test_the_initial_out_of_plane_stress_is_the_horizontal_one():
    test = lab.monotonic_dss(sb.Elastic(G=3e4, K=9e4), sigma_v0=100.0, K0=0.4, gamma_max=1e-3)
    assert test.specimen.stress[3] == pytest.approx(-40.0)


def test_the_allowed_undrained_stress_is_that_of_the_void_ratio():
    """Bolton's critical state at Dr 1/3 of the given void ratio, not at the Dr of the parameters."""
    pressure = 0.01 * 101.3 * math.exp(10.0 - 1.5 * 3.0)
    bound = math.sin(math.radians(33.0)) * pressure / 101.3
    with pytest.raises(sb.InvalidInput, match=f"must be at most {bound:.3f} in absolute value"):
        lab.cyclic_dss(SAND, csr=5.0, void_ratio=0.7)


def test_the_allowed_drained_stress_is_that_of_the_void_ratio():
    dense = sb.PM4Sand(Dr=0.8, G0=677.0, hpo=0.4)
    allowed = []
    for soil, void_ratio in ((dense, None), (SAND, dense.initial_void_ratio), (SAND, None)):
        with pytest.raises(sb.InvalidInput, match=r"must be at most .* in absolute value") as refused:
            lab.cyclic_dss(soil, csr=9.0, drained=True, void_ratio=void_ratio)
        allowed.append(refused.value.allowed)
    assert allowed[0] == allowed[1] != allowed[2]


def test_damping_of_perfect_plasticity_is_that_of_the_parallelogram():
    soil = sb.TotalStress(Su=30.0, G=1e4, K=1e5)
    test = lab.modulus_reduction(soil, K0=1.0, strains=[1e-3, 6e-3, 3e-2], drained=False)
    yielding = np.minimum(1.0, 3e-3 / test.gamma)
    assert test.G_ratio == pytest.approx(yielding, rel=1e-9)
    assert test.damping == pytest.approx(2.0 / np.pi * (1.0 - yielding), abs=1e-9)


@pytest.mark.parametrize("cycles", [1, 3])
def test_modulus_is_that_of_the_last_loop(cycles):
    strain = 1e-3
    found = lab.modulus_reduction(SAND, strains=[strain], cycles=cycles)
    turns = [strain, -strain] * cycles + [strain]
    rows = lab.cyclic_dss(SAND, drained=True, gamma_reversals=turns).peaks()
    assert found.G[0] == pytest.approx((rows.tau[-1] - rows.tau[-2]) / (2.0 * strain), rel=1e-4)


def test_contraction_in_reconsolidation_is_zero_at_its_beginning():
    test = lab.cyclic_dss(SAND, drained=True, gamma_reversals=[5e-3, -5e-3])
    assert test.eps_v[-1] > 1e-4
    assert lab.reconsolidation(test).eps_v[0] == 0.0
