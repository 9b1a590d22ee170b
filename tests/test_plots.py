"""Pictures: each is drawn from the results, every axis has a label, references share the panels."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import scenes
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from sandboil import FreeField, Gravity, InvalidInput, Output, Region, Run, polygon, run
from sandboil.results.plots import column, plot, pore_pressure, section, stress_paths, surface
from sandboil.results.reference import Reference

PNG = b"\x89PNG"


@pytest.fixture(scope="module")
def reference_folder(finished: Run, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The run's own results in the form of another code's, halved to distinguish them."""
    folder = tmp_path_factory.mktemp("reference")

    def write(name: str, **columns: np.ndarray) -> None:
        table = np.column_stack(list(columns.values()))
        np.savetxt(folder / name, table, delimiter=",", header=",".join(columns), comments="")

    time = finished.history("r_u", depth=1.0).time
    surface_g = finished.history("acceleration_x", unit="g").values
    write(
        "histories.csv",
        time_s=time,
        acc_surface_g=0.5 * surface_g,
        ru_1m=0.5 * finished.history("r_u", depth=1.0).values,
    )
    spectrum = finished.spectrum()
    write("spectrum.csv", period_s=spectrum.periods, psa_surface_g_5pct=0.5 * spectrum.psa_g)
    stress = {
        name: 0.5 * finished.history(ours, depth=1.0).values
        for name, ours in (
            ("tau_kPa_1m", "tau_xy"),
            ("sv_eff_kPa_1m", "sigma_v_eff"),
            ("gamma_1m", "gamma_xy"),
        )
    }
    write("stress_strain.csv", time_s=time, **stress)
    return folder


def lines(axes: Axes) -> dict[str, np.ndarray]:
    """The y values of the labelled lines of a panel by the first word of their label."""
    return {str(line.get_label()).split(",")[0]: np.asarray(line.get_ydata()) for line in axes.get_lines()}


def axes_without_words(figure: Figure) -> list[Axes]:
    """Panels without a label at either axis, save those that share the one below and colour bars."""
    return [axes for axes in figure.axes if not axes.get_ylabel() and not axes.get_xlabel()]


def test_every_picture_is_written(finished: Run, tmp_path: Path, reference_folder: Path) -> None:
    paths = plot(finished, tmp_path, reference=Reference.read(reference_folder))
    names = ["surface.png", "pore_pressure.png", "column.png", "energy.png", "stress_paths.png"]
    assert [path.name for path in paths] == names
    assert all(path.read_bytes().startswith(PNG) for path in paths)


def test_pictures_lie_in_the_folder_of_the_run_by_default(tmp_path: Path) -> None:
    results = run(scenes.dry_column(), tmp_path)
    paths = plot(results)
    assert {path.parent for path in paths} == {tmp_path / "plots"}
    # Without water there is no pore pressure to draw.
    assert [path.name for path in paths] == ["surface.png", "column.png", "energy.png", "stress_paths.png"]


def test_a_slope_is_drawn_as_a_section(tmp_path: Path) -> None:
    bank = polygon([(0, 0), (8, 0), (8, 2), (6, 2), (2, 4), (0, 4)])
    ground = Region("ground", bank, scenes.ROCK, dry_unit_weight=20.0)
    results = run(
        scenes.dry_column(regions=[ground], sides=FreeField(), output=Output(depths=[1.0])), tmp_path
    )
    assert "section.png" in [path.name for path in plot(results)]
    (axes, _) = section(results).axes
    edge = next(line for line in axes.get_lines() if line.get_label() == "at rest")
    np.testing.assert_array_equal(edge.get_ydata(), [0, 0, 2, 2, 4, 4, 0])
    # The mid column ends where the slope does, not where the section does.
    assert column(results).axes[-1].get_ylim()[0] == 3.0


def test_every_axis_says_what_it_shows(finished: Run) -> None:
    for draw in (surface, pore_pressure, column, stress_paths):
        figure = draw(finished)
        assert not axes_without_words(figure), draw.__name__
        figure.canvas.draw()


def test_the_surface_picture_shows_surface_input_and_spectra(finished: Run, reference_folder: Path) -> None:
    figure = surface(finished, reference=Reference.read(reference_folder))
    top, spectrum, bottom = (figure.axes[i] for i in (0, 1, 2))
    ours = finished.history("acceleration_x", unit="g").values
    drawn = lines(top)
    np.testing.assert_array_equal(drawn["surface"], ours)
    np.testing.assert_allclose(drawn["reference"], 0.5 * ours)
    np.testing.assert_array_equal(lines(bottom)["outcrop motion"], scenes.PULSE.acceleration_g)
    drawn = lines(spectrum)
    np.testing.assert_array_equal(drawn["surface"], finished.spectrum().psa_g)
    np.testing.assert_array_equal(drawn["outcrop motion"], scenes.PULSE.response_spectrum().psa_g)
    np.testing.assert_allclose(drawn["reference"], 0.5 * finished.spectrum().psa_g)


def test_pore_pressures_have_a_panel_per_depth(finished: Run, reference_folder: Path) -> None:
    upper, lower = pore_pressure(finished, reference=Reference.read(reference_folder)).axes
    np.testing.assert_array_equal(lines(upper)["sandboil"], finished.history("r_u", depth=1.0).values)
    np.testing.assert_array_equal(lines(lower)["sandboil"], finished.history("r_u", depth=3.0).values)
    assert "reference" in lines(upper)
    assert "reference" not in lines(lower), "it has no such depth"


def test_the_column_is_drawn_against_its_base_and_says_its_scale(finished: Run) -> None:
    _, sway, _ = column(finished).axes
    assert "times larger" in sway.get_title(loc="left")
    last = sway.get_lines()[-1]
    profile = finished.profile("displacement")
    np.testing.assert_allclose(last.get_xdata(), 100.0 * (profile.values[:, 0] - profile.values[-1, 0]))
    np.testing.assert_array_equal(last.get_ydata(), profile.depth)


def test_stress_paths_are_drawn_over_stress_and_strain(finished: Run) -> None:
    over_stress, over_strain, *_ = stress_paths(finished).axes
    np.testing.assert_array_equal(
        over_stress.get_lines()[0].get_xdata(), finished.history("sigma_v_eff", depth=1.0).values
    )
    np.testing.assert_array_equal(
        over_strain.get_lines()[0].get_xdata(), 100.0 * finished.history("gamma_xy", depth=1.0).values
    )
    np.testing.assert_array_equal(
        over_strain.get_lines()[0].get_ydata(), finished.history("tau_xy", depth=1.0).values
    )


def test_a_run_without_shaking_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InvalidInput, match="must be a shaking stage of the run: none"):
        plot(run(scenes.column(stages=[Gravity()]), tmp_path))


def test_an_invalid_reference_is_refused(tmp_path: Path, finished: Run, reference_folder: Path) -> None:
    with pytest.raises(InvalidInput, match=r"histories\.csv"):
        Reference.read(tmp_path)
    for name in ("histories", "spectrum", "stress_strain"):
        (tmp_path / f"{name}.csv").write_text("time_s,other\n0.0,1.0\n")
    with pytest.raises(InvalidInput, match="must have a column acc_surface_g"):
        surface(finished, reference=Reference.read(tmp_path))
    (tmp_path / "spectrum.csv").write_text("period_s,psa_g\n0.0,one\n")
    with pytest.raises(InvalidInput, match=r"spectrum\.csv"):
        Reference.read(tmp_path)
