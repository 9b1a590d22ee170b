"""Deconvolution: closed forms, convolution and back, the solver, convergence, warnings, errors."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from sandboil import (
    CompliantBase,
    Elastic,
    Gravity,
    HalfSpace,
    InvalidInput,
    ModulusCurve,
    Motion,
    Output,
    PM4Sand,
    PressureElastic,
    Region,
    Scene,
    Shaking,
    SiteLayer,
    SiteProfile,
    Water,
    WaterTable,
    box,
    run,
)
from sandboil.site import DeconvolutionWarning, darendeli, deconvolution

ROCK = HalfSpace(22.0, 800.0)
LAYERED = SiteProfile(
    [
        SiteLayer(4.0, 18.0, 150.0, damping=0.03),
        SiteLayer(7.0, 19.0, 220.0, damping=0.02),
        SiteLayer(15.0, 20.0, 400.0, damping=0.01),
    ],
    half_space=ROCK,
)


def ground(
    *, thickness: float = 1.0, count: int = 10, Vs: float = 200.0, stress: float = 50.0
) -> SiteProfile:
    """Layers of sand on rock, all with the published curve at `stress`, kPa."""
    return SiteProfile([SiteLayer(thickness, 19.0, Vs, curve=darendeli(stress))] * count, half_space=ROCK)


def pulse(quiet: float = 0.5, dt: float = 0.0025, **changes: Any) -> Motion:
    """A Ricker pulse of 4 Hz in a record of 4 s, with `quiet` seconds of zeros before it."""
    ricker = Motion.ricker(frequency=4.0, pga_g=0.05, dt=dt)
    before = np.zeros(round(quiet / dt))
    samples = np.concatenate([before, ricker.acceleration_g])
    return Motion(dt=dt, acceleration_g=np.pad(samples, (0, round(4.0 / dt) - samples.size)), **changes)


def convolved(
    outcrop: Motion, profile: SiteProfile, G_ratio: Any = None, damping: Any = None
) -> tuple[Motion, Motion]:
    """Motions at the surface and within the base that belong to an outcrop motion.

    Computed with transfer matrices of displacement and shear stress. Default: values at small strain.
    """
    small = np.array([layer.at(0.0) for layer in profile.layers]).T
    ratios, dampings = (small[0], small[1]) if G_ratio is None else (G_ratio, damping)
    size = 8 * outcrop.acceleration_g.size
    omega = 2.0 * np.pi * np.maximum(np.fft.rfftfreq(size, outcrop.dt), 1e-9)
    u, tau = np.ones((2, omega.size), complex) * [[1.0], [0.0]]
    for layer, ratio, ksi in zip(profile.layers, ratios, dampings, strict=True):
        rho = layer.unit_weight / 9.81
        G = rho * layer.Vs**2 * ratio * (1.0 - 2.0 * ksi**2 + 2j * ksi * np.sqrt(1.0 - ksi**2))
        k = omega * np.sqrt(rho / G)
        kh = k * layer.thickness
        u, tau = np.cos(kh) * u + np.sin(kh) / (k * G) * tau, -k * G * np.sin(kh) * u + np.cos(kh) * tau
    impedance = profile.base.unit_weight / 9.81 * profile.base.Vs
    above = np.fft.rfft(outcrop.acceleration_g, size) / (u + tau / (1j * omega * impedance))
    surface, within = (np.fft.irfft(part, size)[: outcrop.acceleration_g.size] for part in (above, above * u))
    return Motion(dt=outcrop.dt, acceleration_g=surface), Motion(
        dt=outcrop.dt, acceleration_g=within, kind="within"
    )


def difference(found: Motion, expected: Motion, below: float) -> float:
    """Largest difference of two Fourier spectra below a frequency, Hz, over the largest of `expected`."""
    size = 4 * expected.acceleration_g.size
    kept = np.fft.rfftfreq(size, expected.dt) < below
    a, b = (np.fft.rfft(motion.acceleration_g, size)[kept] for motion in (found, expected))
    return float(np.abs(a - b).max() / np.abs(b).max())


# Closed forms


@pytest.mark.parametrize(
    ("at", "kind"),
    [
        ("surface", "outcrop"),
        ("surface", "within"),
        ("surface", "upgoing"),
        ("base", "outcrop"),
        ("base", "upgoing"),
    ],
)
def test_one_undamped_layer_gives_the_sum_of_two_shifted_records(at: str, kind: str) -> None:
    """2 A = (1 + a)/2 s(t + T) + (1 - a)/2 s(t - T)."""
    travel, dt = 0.05, 0.0025
    profile = SiteProfile([SiteLayer(10.0, 18.0, 200.0)], half_space=HalfSpace(22.0, 500.0))
    contrast = 18.0 * 200.0 / (22.0 * 500.0)
    surface = pulse(dt=dt)
    early, late = (np.roll(surface.acceleration_g, shift * round(travel / dt)) for shift in (-1, 1))
    outcrop = 0.5 * ((1.0 + contrast) * early + (1.0 - contrast) * late)
    whole = surface.acceleration_g if at == "surface" else outcrop
    record: Any = 0.5 * whole if kind == "upgoing" else whole
    found = Motion(dt=dt, acceleration_g=record, kind=kind).deconvolved(profile, at=at, linear=True)
    assert (found.kind, found.dt, found.duration) == ("outcrop", dt, surface.duration)
    np.testing.assert_allclose(found.acceleration_g, outcrop, rtol=0.0, atol=1e-5 * 0.05)


@pytest.mark.parametrize("damping", [0.0, 0.02, 0.05])
def test_one_damped_layer_has_the_transfer_function_of_the_textbook(damping: float) -> None:
    """|F| = 1/sqrt(cos^2 kH + sinh^2 (damping kH)) on rigid rock (Kramer 1996, section 7.2)."""
    thickness, Vs, dt = 20.0, 200.0, 0.005
    profile = SiteProfile([SiteLayer(thickness, 18.0, Vs, damping=damping)], half_space=HalfSpace(1e9, 1e6))
    surface = pulse(dt=dt)
    base = surface.deconvolved(profile, linear=True)
    size = 8 * surface.acceleration_g.size
    frequency = np.fft.rfftfreq(size, dt)
    kept = (frequency > 1.0) & (frequency < 10.0)
    amplitude = [np.abs(np.fft.rfft(motion.acceleration_g, size))[kept] for motion in (base, surface)]
    kH = 2.0 * np.pi * frequency[kept] * thickness / Vs
    # The textbook formula neglects terms of second order in damping.
    exact = np.sqrt(np.cos(kH) ** 2 + np.sinh(damping * kH) ** 2)
    np.testing.assert_allclose(amplitude[0] / amplitude[1], exact, atol=1e-4 + 4.0 * damping**2)


@pytest.mark.parametrize("at", ["surface", "base"])
def test_deconvolution_inverts_convolution_by_matrices(at: str) -> None:
    outcrop = Motion.synthetic(pga_g=0.1, duration=20.0)
    surface, within = convolved(outcrop, LAYERED)
    found = deconvolution(surface if at == "surface" else within, LAYERED, at=at, linear=True)
    assert difference(found.motion, outcrop, below=20.0) < 0.01
    assert (found.converged, found.iterations) == (True, 1)
    np.testing.assert_array_equal(found.G_ratio, 1.0)
    np.testing.assert_allclose(found.damping, [0.03, 0.02, 0.01])


def test_strain_of_slow_waves_is_quasi_static() -> None:
    """Far below the first natural frequency of the ground, gamma = rho z a / G."""
    record = Motion.ricker(frequency=0.5, pga_g=0.01)
    profile = SiteProfile([SiteLayer(1.0, 18.0, 300.0)] * 3, half_space=ROCK)
    expected = profile.depth * 0.01 * 9.81 / 300.0**2
    np.testing.assert_allclose(deconvolution(record, profile).strain, expected, rtol=2e-3)


def test_a_motion_given_by_velocity_gives_a_velocity() -> None:
    surface = pulse()
    as_velocity = Motion(dt=surface.dt, velocity=surface.velocity)
    found = as_velocity.deconvolved(LAYERED, linear=True)
    assert found.quantity == "velocity"
    assert difference(found, surface.deconvolved(LAYERED, linear=True), below=15.0) < 0.01


def test_frequencies_above_the_cut_are_removed() -> None:
    fast = 0.01 * np.sin(2.0 * np.pi * 40.0 * pulse().time)
    noisy = Motion(dt=0.0025, acceleration_g=pulse().acceleration_g + fast)
    options: dict[str, Any] = {"linear": True, "max_frequency": 15.0}
    found, expected = (motion.deconvolved(LAYERED, **options) for motion in (noisy, pulse()))
    # The sine begins and ends suddenly, so it has a small part at every frequency.
    np.testing.assert_allclose(found.acceleration_g, expected.acceleration_g, rtol=0.0, atol=0.1 * 0.01)


# The solver of sandboil


def test_the_surface_motion_of_a_run_gives_back_its_input_motion(tmp_path: Path) -> None:
    """Two saturated elastic layers on a stiffer base, with 40 particles per shortest wavelength at 10 Hz."""
    applied = Motion.ricker(frequency=4.0, pga_g=0.1)
    soils = {
        "soft": (Elastic(G=2.0e4, K=5.0e4), (6.0, 12.0)),
        "stiff": (Elastic(G=6.0e4, K=1.5e5), (0.0, 6.0)),
    }
    scene = Scene(
        spacing=0.25,
        water=Water(),
        water_table=WaterTable(depth=0.0),
        regions=[
            Region(name, box(x=(0, 0.5), y=y), soil, Gs=2.67, porosity=0.4)
            for name, (soil, y) in soils.items()
        ],
        stages=[Gravity(), Shaking(applied, base=CompliantBase(Vs=400.0, density=2.2), duration=4.0)],
        output=Output(history_dt=0.005),
    )
    surface = run(scene, tmp_path / "run", threads=1).history("acceleration_x", unit="g")
    record = Motion(dt=float(surface.time[1]), acceleration_g=surface.values)
    found = record.deconvolved(scene.profile(), linear=True)
    expected = np.interp(record.time, applied.time, applied.acceleration_g, right=0.0)
    assert difference(found, Motion(dt=record.dt, acceleration_g=expected), below=10.0) < 0.02
    # Without deconvolution the two motions are very different.
    assert difference(record, Motion(dt=record.dt, acceleration_g=expected), below=10.0) > 0.5


# Equivalent-linear analysis


def test_equivalent_linear_deconvolution_inverts_convolution_with_the_same_strains() -> None:
    outcrop = Motion.synthetic(pga_g=0.1, duration=20.0)
    options: dict[str, Any] = {"tolerance": 1e-4, "max_frequency": 15.0}
    up = deconvolution(outcrop, ground(), at="base", **options)
    surface, _ = convolved(up.motion, ground(), up.G_ratio, up.damping)
    down = deconvolution(surface, ground(), **options)
    assert up.converged
    assert down.converged
    assert 0.3 < down.G_ratio.min() < 0.9
    np.testing.assert_allclose(down.strain, up.strain, rtol=0.01)
    assert difference(down.motion, up.motion, below=15.0) < 0.01


def test_stiffness_and_damping_are_those_of_the_effective_strain() -> None:
    profile = ground()
    found = deconvolution(Motion.synthetic(pga_g=0.1), profile, tolerance=1e-6, strain_ratio=0.5)
    expected = np.array(
        [layer.at(0.5 * strain) for layer, strain in zip(profile.layers, found.strain, strict=True)]
    )
    np.testing.assert_allclose(np.array([found.G_ratio, found.damping]).T, expected, rtol=1e-5)


def level_ground() -> Scene:
    return Scene.from_toml(Path(__file__).parents[1] / "examples" / "level_ground" / "scene.toml")


def test_stiffness_of_level_ground_decreases_with_the_motion() -> None:
    profile = level_ground().profile()
    weak, strong = (deconvolution(Motion.synthetic(pga_g=pga), profile) for pga in (0.05, 0.1))
    assert not weak.doubts
    assert not strong.doubts
    assert weak.iterations < strong.iterations
    assert (strong.strain > weak.strain).all()
    assert (strong.G_ratio < weak.G_ratio).all()
    # pystrata 0.5.4 gives this largest strain, and this stiffness at it, with the same curves.
    assert weak.strain.max() == pytest.approx(1.4e-4, rel=0.02)
    assert weak.G_ratio.min() == pytest.approx(0.648, abs=0.01)


def test_a_surface_motion_that_loose_sand_cannot_carry_is_refused() -> None:
    with pytest.raises(
        InvalidInput, match=r"this ground can carry .* shear strain of .* scale the motion down"
    ):
        Motion.synthetic(pga_g=0.3).deconvolved(level_ground().profile())


def test_the_published_curve_agrees_with_pystrata() -> None:
    """DarendeliSoilType of pystrata 0.5.4, plasticity index 15 %, 100 kPa."""
    curve = darendeli(100.0, 15.0, strains=[1e-6, 1e-5, 1e-4, 1e-3, 1e-2])
    np.testing.assert_allclose(curve.G_ratio, [0.996701, 0.973263, 0.81435, 0.345801, 0.059882], atol=1e-6)
    # The constants of pystrata differ in the last printed digit.
    np.testing.assert_allclose(curve.damping, [0.010247, 0.012627, 0.033389, 0.122652, 0.204751], rtol=2e-4)


# Profiles of scenes


def test_a_scene_gives_the_small_strain_stiffness_at_rest() -> None:
    profile = level_ground().profile(thickness=2.0)
    assert len(profile.layers) == 10
    assert sum(layer.thickness for layer in profile.layers) == pytest.approx(20.0)
    sand = level_ground().regions[0]
    assert isinstance(sand.material, PM4Sand)
    phases = sand.resolved(level_ground())
    assert profile.layers[0].unit_weight == pytest.approx(9.81 * phases.saturated_density)
    # G = G0 p_atm sqrt(p/p_atm), except for the factor of the stress ratio, which depends slightly on
    # pressure.
    speeds = np.array([layer.Vs for layer in profile.layers[:4]])
    np.testing.assert_allclose(speeds / speeds[0], (profile.depth[:4] / profile.depth[0]) ** 0.25, rtol=5e-3)
    assert profile.base.Vs > profile.layers[-1].Vs
    curve = profile.layers[0].curve
    assert curve is not None
    mean_stress = (9.81 * phases.saturated_density - 10.0) * profile.depth[0] * (1.0 + 2.0 * sand.K0) / 3.0
    np.testing.assert_allclose(curve.G_ratio, darendeli(mean_stress).G_ratio)


def test_elastic_ground_has_no_curve_and_the_half_space_is_the_base_of_the_scene() -> None:
    soils = {"a": Elastic(G=2.0e4, K=5.0e4), "b": PressureElastic(G=6.0e4, K=1.5e5)}
    scene = Scene(
        spacing=0.5,
        regions=[
            Region(name, box(x=(0, 1), y=(-2 * i - 2, -2 * i)), soil, dry_unit_weight=18.0)
            for i, (name, soil) in enumerate(soils.items())
        ],
        stages=[Gravity(), Shaking(duration=1.0, base=CompliantBase(Vs=500.0, density=2.0))],
    )
    profile = scene.profile(0.2, thickness=10.0)
    assert [layer.curve for layer in profile.layers] == [None, None]
    assert [layer.thickness for layer in profile.layers] == [2.0, 2.0]
    assert profile.layers[0].Vs == pytest.approx((2.0e4 / (18.0 / 9.81)) ** 0.5)
    assert profile.base == HalfSpace(2.0 * 9.81, 500.0)
    # No layer is thinner than the spacing of particles.
    assert len(scene.profile(thickness=1e-3).layers) == 8


def test_curves_may_be_those_of_the_soil_model() -> None:
    scene = Scene(
        spacing=1.0,
        water=Water(),
        water_table=WaterTable(depth=0.0),
        regions=[Region("sand", box(x=(0, 1), y=(0, 6)), PM4Sand(Dr=0.55, G0=677.0, hpo=0.4), Gs=2.67)],
        stages=[Gravity()],
    )
    curve = scene.profile(curves="material", thickness=6.0).layers[0].curve
    assert curve is not None
    ratio, damping = curve.at(1e-3)
    assert 0.05 < ratio < 0.4
    assert 0.15 < damping < 0.4


def test_the_default_half_space_has_the_properties_of_the_lowest_layer() -> None:
    assert SiteProfile([SiteLayer(1.0, 18.0, 100.0), SiteLayer(2.0, 19.0, 150.0)]).base == HalfSpace(
        19.0, 150.0
    )


# Warnings


@pytest.mark.parametrize(
    ("record", "profile", "options", "message"),
    [
        (Motion.synthetic(pga_g=0.1), ground(), {"max_iterations": 2}, "do not agree after 2 iterations"),
        (
            Motion.synthetic(pga_g=0.4),
            ground(Vs=120.0),
            {"at": "base"},
            "shear strain of .* exceeds the 0.5 %",
        ),
        (
            Motion.synthetic(pga_g=0.01),
            SiteProfile([SiteLayer(30.0, 18.0, 100.0, damping=0.1)]),
            {},
            "waves of 20 Hz, and their noise, are amplified",
        ),
        (
            pulse(quiet=0.0),
            SiteProfile([SiteLayer(60.0, 18.0, 100.0)]),
            {},
            "lies before or after the record",
        ),
    ],
    ids=["not converged", "strain", "amplification", "lost"],
)
def test_a_doubtful_motion_gives_a_warning_with_the_reason(
    record: Motion, profile: SiteProfile, options: dict[str, Any], message: str
) -> None:
    with pytest.warns(DeconvolutionWarning, match=message):
        record.deconvolved(profile, **options)


def test_the_report_has_convergence_layers_and_reasons_for_doubt() -> None:
    found = deconvolution(Motion.synthetic(pga_g=0.1), ground(count=3), max_iterations=1)
    text = str(found)
    assert "1 iterations, not converged" in text
    assert (
        len([line for line in text.splitlines() if line.lstrip().startswith(("0.50", "1.50", "2.50"))]) == 3
    )
    assert "doubtful: stiffness" in text


# Errors

BAD: dict[str, tuple[Callable[[], object], str, object, str]] = {
    "no layers": (lambda: SiteProfile([]), "profile.layers", [], "each a SiteLayer"),
    "thickness": (lambda: SiteLayer(-1.0, 18.0, 100.0), "layer.thickness", -1.0, "greater than 0 (m)"),
    "unit weight": (lambda: SiteLayer(1.0, 0.0, 100.0), "layer.unit_weight", 0.0, "kN/m3"),
    "Vs": (
        lambda: SiteProfile([{"thickness": 1.0, "unit_weight": 18.0, "Vs": 0.0}]),
        "profile.layers[0].Vs",
        0.0,
        "greater than 0",
    ),
    "damping": (lambda: SiteLayer(1.0, 18.0, 100.0, damping=0.5), "layer.damping", 0.5, "[0, 0.5)"),
    "negative damping": (
        lambda: SiteLayer(1.0, 18.0, 100.0, damping=-0.1),
        "layer.damping",
        -0.1,
        "[0, 0.5)",
    ),
    "damping twice": (
        lambda: SiteLayer(1.0, 18.0, 100.0, damping=0.02, curve=darendeli(50.0)),
        "layer.damping",
        0.02,
        "must be left out with a curve",
    ),
    "half-space": (lambda: HalfSpace(22.0, float("nan")), "half_space.Vs", None, "finite"),
    "strains decrease": (
        lambda: ModulusCurve(strain=[1e-3, 1e-4], G_ratio=[1.0, 0.5], damping=[0.0, 0.1]),
        "curve.strain",
        (1e-3, 1e-4),
        "must be strictly increasing",
    ),
    "ragged curve": (
        lambda: ModulusCurve(strain=[1e-4, 1e-3], G_ratio=[1.0], damping=[0.0, 0.1]),
        "curve.G_ratio",
        (1.0,),
        "one value per strain",
    ),
    "curve's damping": (
        lambda: ModulusCurve(strain=[1e-4], G_ratio=[1.0], damping=[5.0]),
        "curve.damping[0]",
        5.0,
        "5 % of critical is written 0.05",
    ),
    "short motion": (
        lambda: Motion.ricker(4.0, 0.1).deconvolved(SiteProfile([SiteLayer(100.0, 18.0, 0.1)])),
        "site.deconvolution.motion.duration",
        0.75,
        "must exceed the travel time of a shear wave through the profile, 1000 s",
    ),
    "cut": (
        lambda: pulse(dt=0.02).deconvolved(LAYERED, max_frequency=25.1),
        "site.deconvolution.max_frequency",
        25.1,
        "Nyquist frequency 1/(2 dt) = 25 Hz",
    ),
    "cut at zero": (
        lambda: pulse().deconvolved(LAYERED, max_frequency=0.0),
        "site.deconvolution.max_frequency",
        0.0,
        "greater than 0",
    ),
    "place": (
        lambda: pulse().deconvolved(LAYERED, at="top"),
        "site.deconvolution.at",
        "top",
        "'surface', 'base'",
    ),
    "strain ratio": (
        lambda: pulse().deconvolved(LAYERED, strain_ratio=65.0),
        "site.deconvolution.strain_ratio",
        65.0,
        "(0, 1]",
    ),
    "unknown option": (
        lambda: pulse().deconvolved(LAYERED, max_freqency=15.0),
        "site.deconvolution.max_freqency",
        15.0,
        "did you mean 'max_frequency'?",
    ),
    "no profile": (lambda: pulse().deconvolved(None), "site.deconvolution.profile", None, "SiteProfile"),
    "no motion": (
        lambda: deconvolution([0.1], LAYERED),
        "site.deconvolution.motion",
        [0.1],
        "must be a Motion",
    ),
    "overflow": (
        lambda: deconvolution(
            REST, SiteProfile([SiteLayer(300.0, 18.0, 100.0, damping=0.49)] * 4), linear=True
        ),
        "site.deconvolution.motion",
        None,
        "lower max_frequency",
    ),
    "place of a scene": (lambda: level_ground().profile(2.0), "scene.profile.x", 2.0, "[0, 1] m"),
    "curves": (
        lambda: level_ground().profile(curves="darendelli"),
        "scene.profile.curves",
        "darendelli",
        "did you mean 'darendeli'?",
    ),
}
REST = Motion(dt=0.01, acceleration_g=np.zeros(10_000))


@pytest.mark.parametrize("case", BAD)
def test_errors_give_place_value_and_remedy(case: str) -> None:
    call, path, value, part = BAD[case]
    with pytest.raises(InvalidInput) as caught:
        call()
    assert caught.value.path == path
    if value is not None:
        assert caught.value.value == value
    assert part in str(caught.value)


def test_a_motion_at_rest_stays_at_rest() -> None:
    found = deconvolution(REST, ground())
    assert found.motion.pga_g == 0.0
    assert found.converged
    assert not found.doubts
