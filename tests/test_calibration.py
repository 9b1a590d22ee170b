"""Cyclic resistance, its curves and factors, and calibration to a cyclic resistance."""

import math
import warnings

import numpy as np
import pytest
import sandboil as sb
from sandboil import lab
from sandboil.lab import correlations

# Table 1 of Mhaski and Ramana (2025): Dr, G0, CRR, hpo; and the void ratio of OpenSees after consolidation.
TABLE_1 = [
    (0.35, 476.0, 0.090, 0.53, 0.694110),
    (0.55, 677.0, 0.147, 0.40, 0.634396),
    (0.75, 890.0, 0.312, 0.63, 0.574558),
]


def sand(row):
    Dr, G0, _, hpo, _ = row
    return sb.PM4Sand(Dr=Dr, G0=G0, hpo=hpo)


@pytest.mark.parametrize(("row", "allowed"), list(zip(TABLE_1, (0.05, 0.05, 0.15), strict=True)))
def test_calibration_finds_the_published_contraction_rate(row, allowed):
    Dr, G0, crr, hpo, void_ratio = row
    found = lab.calibrate_hpo(Dr=Dr, G0=G0, crr=crr, cycles=15, gamma_sa=0.03, void_ratio=void_ratio)
    assert found.hpo == pytest.approx(hpo, rel=allowed)


@pytest.mark.parametrize("row", TABLE_1)
def test_resistance_of_a_calibrated_sand_is_the_target(row):
    Dr, G0, _, hpo, _ = row
    resistance = lab.crr(sand(row))
    result = lab.calibration(Dr, G0, resistance)
    assert result.met
    assert result.achieved == pytest.approx(resistance, rel=5e-3)
    # Cycles are counted by halves, so a range of contraction rates has the same resistance; the calibration
    # finds the same end of that range.
    assert lab.crr(result.soil) == pytest.approx(resistance, rel=2e-3)
    assert result.soil.hpo == pytest.approx(hpo, rel=0.01)


def test_resistance_is_the_largest_stress_ratio_that_needs_the_cycles():
    soil = sand(TABLE_1[1])
    resistance = lab.crr(soil, cycles=10)
    for factor, halves in ((0.999, 20), (1.001, 19)):
        cycles = lab.cyclic_dss(soil, csr=factor * resistance).cycles_to(gamma_sa=0.03)
        assert math.ceil(2.0 * (cycles + 0.25)) == halves


def test_stricter_criteria_need_more_stress():
    soil = sand(TABLE_1[0])
    by_strain = [lab.crr(soil, gamma_sa=strain) for strain in (0.01, 0.03, 0.05)]
    assert by_strain == sorted(by_strain)
    assert lab.crr(soil, cycles=5) > lab.crr(soil, cycles=15) > lab.crr(soil, cycles=30)


def test_curve_has_three_criteria_and_decreases():
    curve = lab.crr_curve(sand(TABLE_1[1]))
    assert list(curve.cycles) == list(lab._resistance.CRITERIA)
    for cycles in curve.cycles.values():
        assert np.isfinite(cycles).all()
        assert (np.diff(cycles) < 0.0).all()
    assert curve.csr_at(15.0) == pytest.approx(0.146, rel=0.02)
    assert math.isnan(curve.csr_at(1e4))
    assert curve.to_dataframe().shape == (8, 4)


def test_curve_of_given_ratios_is_nan_where_a_criterion_is_not_met():
    curve = lab.crr_curve(sand(TABLE_1[1]), csr=[0.02, 0.2], max_cycles=10)
    cycles = curve.cycles["3 % single amplitude"]
    assert math.isnan(cycles[0])
    assert 3.0 < cycles[1] < 8.0


@pytest.mark.parametrize(
    ("row", "factors"), list(zip(TABLE_1, [(1.08, 0.87), (1.12, 0.81), (1.18, 0.77)], strict=True))
)
def test_overburden_reduces_resistance(row, factors):
    curve = lab.k_sigma(sand(row), (0.5 * correlations.P_ATM, 4.0 * correlations.P_ATM))
    assert curve.factor == pytest.approx(factors, rel=0.02)
    assert curve.published[0] > 1.0 > curve.published[1]


def test_factors_use_the_given_earth_pressure():
    soil = sand(TABLE_1[0])
    curve = lab.k_sigma(soil, (200.0,), K0=1.0)
    assert curve.crr[0] == lab.crr(soil, sigma_v0=200.0, K0=1.0)
    assert curve.factor[0] == curve.crr[0] / lab.crr(soil, K0=1.0)


def test_static_shear_changes_resistance_and_the_published_factor_is_given():
    curve = lab.k_alpha(sand(TABLE_1[1]), (0.0, 0.2))
    assert curve.factor[0] == 1.0
    assert curve.factor[1] > 1.2
    assert curve.published == pytest.approx([1.0, 1.146], abs=1e-3)
    assert set(curve.to_dataframe()) == {"x", "crr", "factor", "published"}


def test_correlations_agree_with_the_published_table():
    for Dr, G0, crr, _, _ in TABLE_1:
        blows = correlations.spt_from_relative_density(Dr)
        assert correlations.relative_density_from_spt(blows) == pytest.approx(Dr)
        assert correlations.crr_from_spt(blows) == pytest.approx(crr, rel=2e-3)
        assert correlations.shear_modulus_coefficient(blows) == pytest.approx(G0, rel=4e-3)
    assert correlations.relative_density_from_cpt(100.0) == pytest.approx(0.5496, abs=1e-4)
    assert correlations.crr_from_cpt(100.0) == pytest.approx(0.1373, abs=1e-4)
    assert [
        correlations.k_sigma(4.0 * correlations.P_ATM, N160cs=n) for n in (5.6, 13.9, 25.9)
    ] == pytest.approx([0.89, 0.85, 0.77], abs=0.01)
    assert correlations.k_sigma(50.0, qc1Ncs=100.0) > 1.0


def test_sand_from_field_tests():
    soil = sb.PM4Sand.from_spt(N160cs=14)
    assert soil.Dr == pytest.approx(math.sqrt(14 / 46))
    assert soil.hpo == pytest.approx(0.40, rel=0.1)
    assert sb.PM4Sand.from_density(soil.Dr).hpo == pytest.approx(soil.hpo, rel=1e-3)
    stronger = sb.PM4Sand.from_cpt(qc1Ncs=100.0, crr=0.16, G0=650.0, nb=0.6)
    assert (stronger.G0, stronger.nb) == (650.0, 0.6)
    assert lab.crr(stronger) == pytest.approx(0.16, rel=5e-3)
    # At a larger overburden the resistance is multiplied by K_sigma.
    deep = sb.PM4Sand.from_spt(N160cs=14, sigma_v0=400.0)
    expected = correlations.crr_from_spt(14) * correlations.k_sigma(400.0, N160cs=14)
    assert lab.crr(deep, sigma_v0=400.0) == pytest.approx(expected, rel=5e-3)


def test_a_target_where_the_number_of_cycles_jumps_is_met():
    """The number of cycles varies by a half within one per cent of this stress ratio."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        result = lab.calibration(0.6, 678.357, 0.147901)
    assert result.met
    assert result.achieved == pytest.approx(0.147901, rel=0.01)


def test_sand_denser_than_the_triggering_curve_accepts_a_given_resistance():
    assert correlations.estimates(N160cs=40.0, crr=0.8)["crr"] == 0.8
    assert correlations.crr_from_spt(37.5) == pytest.approx(2.0, rel=0.01)


def test_a_misspelt_parameter_of_the_sand_is_refused_with_the_nearest_name():
    with pytest.raises(sb.InvalidInput, match="did you mean 'z_max'"):
        lab.calibrate_hpo(0.55, 677.0, 0.147, zmax=3.0)


def test_a_target_above_the_strength_is_not_met():
    """The critical-state strength is a ratio of 7.8; above it strain is unlimited in the first stroke."""
    with pytest.warns(lab.CalibrationWarning, match="cannot be met by any contraction rate"):
        result = lab.calibration(0.55, 677.0, 14.7, cycles=5)
    assert not result.met


def test_a_target_that_cannot_be_met_gives_a_warning():
    with pytest.warns(lab.CalibrationWarning, match="cannot be met") as caught:
        result = lab.calibration(0.55, 677.0, 1.4)
    assert not result.met
    assert result.achieved < 1.4
    assert caught[0].filename == __file__


@pytest.mark.parametrize(
    ("call", "path"),
    [
        (lambda: lab.calibrate_hpo(0.55, 677.0, 0.147, cyles=15), "lab.calibration.cyles"),
        (lambda: lab.calibrate_hpo(0.55, 677.0, -0.1), "lab.calibration.crr"),
        (lambda: lab.calibrate_hpo(0.55, 677.0, 0.147, cycles=0.5), "lab.calibration.cycles"),
        (lambda: lab.calibrate_hpo(0.55, 677.0, 0.147, cycles=1e9), "lab.calibration.cycles"),
        (lambda: lab.calibrate_hpo(0.55, 677.0, 0.147, hpo=0.4), "lab.calibration.hpo"),
        (lambda: lab.calibrate_hpo(0.55, 677.0, 0.147, secondary={}), "lab.calibration.secondary"),
        (lambda: lab.calibrate_hpo(55.0, 677.0, 0.147), "material.Dr"),
        (lambda: lab.calibrate_hpo(0.55, 677.0, 0.147, K0=9.0), "lab.calibration.K0"),
        (lambda: lab.crr(sand(TABLE_1[0]), gamma_sa=0.03, r_u=0.9), "lab.criterion"),
        (lambda: lab.crr(sand(TABLE_1[0]), cycles=math.nan), "lab.crr.cycles"),
        (lambda: lab.crr_curve(sand(TABLE_1[0]), csr=[]), "lab.crr_curve.csr"),
        (lambda: lab.k_alpha(sand(TABLE_1[0]), (0.5,)), "correlations.static_shear_ratio"),
        (lambda: lab.k_sigma(sb.Elastic(G=1e4, K=2e4)), "lab.k_sigma.soil"),
        (lambda: correlations.crr_from_spt(38.0), "correlations.N160cs"),
        (lambda: correlations.crr_from_spt("14"), "correlations.N160cs"),
        (lambda: correlations.crr_from_cpt(np.array([90.0, 100.0])), "correlations.qc1Ncs"),
        (lambda: correlations.crr_from_cpt(212.0), "correlations.qc1Ncs"),
        (lambda: correlations.k_sigma(2500.0, N160cs=14), "correlations.sigma_v0"),
        (lambda: correlations.k_alpha(math.nan, Dr=0.5, sigma_v0=100.0), "correlations.static_shear_ratio"),
        (lambda: correlations.k_alpha(0.1, Dr=50, sigma_v0=100.0), "correlations.Dr"),
        (lambda: sb.PM4Sand.from_density(55.0), "correlations.Dr"),
        (lambda: sb.PM4Sand.from_spt(40.0), "correlations.N160cs"),
        (lambda: correlations.relative_density_from_cpt(5.0), "correlations.qc1Ncs"),
        (lambda: correlations.k_sigma(100.0), "correlations.k_sigma"),
        (lambda: correlations.estimates(Dr=0.5, N160cs=10.0), "correlations.estimates"),
        (lambda: sb.PM4Sand.from_spt(N160cs=-1.0), "correlations.N160cs"),
    ],
)
def test_bad_input_is_refused_by_path(call, path):
    with pytest.raises(sb.InvalidInput) as caught:
        call()
    assert caught.value.path == path


def test_plots_have_axis_labels_and_the_target():
    figure = lab.calibration(0.35, 476.0, 0.09).plot()
    axes = figure.axes[0]
    assert "target" in [text.get_text() for text in axes.get_legend().get_texts()]
    assert axes.get_xlabel() == "uniform cycles"
    assert lab.k_sigma(sand(TABLE_1[0]), (50.0, 200.0)).plot().axes[0].get_xlabel().endswith("kPa")


def test_a_curve_counts_the_first_stroke_as_half_a_cycle():
    soil = sand(TABLE_1[1])
    alone = lab.cyclic_dss(soil, csr=0.2).cycles_to(gamma_sa=0.03)
    assert lab.crr_curve(soil, csr=[0.2]).cycles["3 % single amplitude"][0] == alone + 0.25


def test_a_test_continues_to_a_large_double_amplitude():
    soil = sand(TABLE_1[0])
    # If the test ended earlier, no stress ratio below the strength would meet the criterion.
    assert 1.0 < lab.crr(soil, gamma_da=0.15) / lab.crr(soil, gamma_da=0.05) < 1.3


def test_correlations_at_the_limits_of_their_range():
    # The limits 0.3 and 1.1 of the factors, and a resistance where all terms of the polynomial matter.
    dense = correlations.k_sigma(4.0 * correlations.P_ATM, N160cs=45.0)
    assert dense == pytest.approx(1.0 - 0.3 * math.log(4.0))
    assert correlations.k_sigma(10.0, N160cs=45.0) == 1.1
    by_cone = 1.0 - math.log(4.0) / (37.3 - 8.27 * 100.0**0.264)
    assert correlations.k_sigma(4.0 * correlations.P_ATM, qc1Ncs=100.0) == pytest.approx(by_cone)
    assert correlations.crr_from_cpt(175.0) == pytest.approx(0.6, rel=2e-3)
    # Below a relative state index of -0.6 the factor is that at -0.6.
    assert correlations.k_alpha(0.2, Dr=0.9, sigma_v0=100.0) == correlations.k_alpha(
        0.2, Dr=1.0, sigma_v0=100.0
    )
