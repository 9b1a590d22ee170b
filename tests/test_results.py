"""The results file: its layout as VTKHDF, its units, and its reader."""

from __future__ import annotations

import csv
import shutil
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
import scenes
from sandboil import Gravity, InvalidInput, Run, Scene, Shaking, _core, load, response_spectrum, run
from sandboil.results.layout import FILE_NAME, FORMAT_VERSION
from sandboil.results.summary import Summary

# The file


def test_every_dataset_says_its_unit(finished: Run) -> None:
    without = []

    def look(name: str, item: Any) -> None:
        if isinstance(item, h5py.Dataset) and not item.attrs.get("units"):
            without.append(name)

    with h5py.File(finished.path) as file:
        file.visititems(look)
        assert file["VTKHDF/PointData/r_u"].attrs["units"] == b"1"
        assert file["VTKHDF/PointData/sigma_v_eff"].attrs["units"] == b"kPa"
        assert file["histories/shaking/acceleration_x"].attrs["units"] == b"m/s2"
    assert not without


def test_the_file_contains_what_made_it(finished: Run) -> None:
    with h5py.File(finished.path) as file:
        assert file.attrs["format_version"] == FORMAT_VERSION
        assert Scene.from_toml(file["scene"].asstr()[0]) == scenes.column()
    assert finished.scene == scenes.column()
    # Defaults are written out: they may change, the meaning of this file may not.
    assert "smoothing_ratio" in finished.scene.numerics.model_fields_set
    assert set(finished.versions) == {"sandboil", "core", "h5py", "numpy"}
    assert finished.revision == _core.__revision__
    assert finished.machine["threads"] == 1
    assert {"system", "processor", "processors", "python_version"} <= finished.machine.keys()
    assert finished.versions["sandboil"] == finished.versions["core"]


def test_the_file_is_vtkhdf_polydata_in_time(finished: Run) -> None:
    """Against the VTK file format specification, section "VTKHDF", temporal PolyData."""
    nodes, frames = len(finished.position), len(finished.times)
    with h5py.File(finished.path) as file:
        vtk = file["VTKHDF"]
        assert tuple(vtk.attrs["Version"]) == (2, 0)
        assert vtk.attrs["Type"] == b"PolyData"
        assert vtk.attrs.get_id("Type").get_type().get_class() == h5py.h5t.STRING
        assert not vtk.attrs.get_id("Type").get_type().is_variable_str()
        np.testing.assert_array_equal(vtk["NumberOfPoints"], [nodes])
        assert vtk["Points"].shape == (frames * nodes, 3)
        for kind, count in (("Vertices", nodes), ("Lines", 0), ("Polygons", 0), ("Strips", 0)):
            np.testing.assert_array_equal(vtk[kind]["NumberOfCells"], [count])
            np.testing.assert_array_equal(vtk[kind]["NumberOfConnectivityIds"], [count])
            np.testing.assert_array_equal(vtk[kind]["Connectivity"], np.arange(count))
            np.testing.assert_array_equal(vtk[kind]["Offsets"], np.arange(count + 1))
        steps = vtk["Steps"]
        assert steps.attrs["NSteps"] == frames
        np.testing.assert_array_equal(steps["Values"], finished.times)
        offsets = np.arange(frames) * nodes
        np.testing.assert_array_equal(steps["PointOffsets"], offsets)
        np.testing.assert_array_equal(steps["PartOffsets"], np.zeros(frames))
        np.testing.assert_array_equal(steps["NumberOfParts"], np.ones(frames))
        for name in ("CellOffsets", "ConnectivityIdOffsets"):
            np.testing.assert_array_equal(steps[name], np.zeros((frames, 4)))
        assert set(vtk["PointData"]) == set(steps["PointDataOffsets"]) == {*finished.field_names, "region"}
        for name in finished.field_names:
            assert len(vtk["PointData"][name]) == frames * nodes
            np.testing.assert_array_equal(steps["PointDataOffsets"][name], offsets)
        np.testing.assert_array_equal(steps["PointDataOffsets/region"], np.zeros(frames))


def test_vtk_reads_what_we_wrote(finished: Run) -> None:
    io = pytest.importorskip("vtkmodules.vtkIOHDF")
    numpy_support = pytest.importorskip("vtkmodules.util.numpy_support")
    reader = io.vtkHDFReader()
    reader.SetFileName(str(finished.path))
    reader.UpdateInformation()
    assert reader.GetNumberOfSteps() == len(finished.times)
    for step in (0, 4, len(finished.times) - 1):
        reader.SetStep(step)
        reader.Update()
        mesh = reader.GetOutput()
        assert mesh.GetNumberOfPoints() == mesh.GetNumberOfVerts() == len(finished.position)
        time = finished.times[step]
        for name in finished.field_names:
            read = numpy_support.vtk_to_numpy(mesh.GetPointData().GetArray(name))
            expected = finished.field(name, time)
            np.testing.assert_array_equal(read[:, :2] if read.ndim == 2 else read, expected, err_msg=name)
        points = numpy_support.vtk_to_numpy(mesh.GetPoints().GetData())
        present = finished.position + finished.field("displacement", time)
        np.testing.assert_array_equal(points[:, :2], present)
        assert not points[:, 2].any()


def test_vtk_time_continues_in_a_second_shaking_and_stage_time_starts_at_zero(tmp_path: Path) -> None:
    short = Shaking(scenes.PULSE, duration=0.2)
    results = run(scenes.column(stages=[Gravity(), short, short]), tmp_path)
    assert results.stages == ["gravity", "shaking", "shaking_2"]
    np.testing.assert_allclose(results.frame_times("shaking"), [0.0, 0.1, 0.2], atol=1e-3)
    np.testing.assert_allclose(results.frame_times("shaking_2"), [0.0, 0.1, 0.2], atol=1e-3)
    with h5py.File(results.path) as file:
        np.testing.assert_allclose(file["VTKHDF/Steps/Values"], [0, 0.1, 0.2, 0.2, 0.3, 0.4], atol=2e-3)


# Histories


def test_histories_are_found_by_place_and_by_depth(finished: Run) -> None:
    by_depth = finished.history("r_u", depth=1.0)
    by_place = finished.history("r_u", at=(0.25, 3.0))
    np.testing.assert_array_equal(by_depth.values, by_place.values)
    assert by_depth.label == "depth 1 m"
    surface = finished.history("acceleration_x")
    np.testing.assert_array_equal(surface.values, finished.history("acceleration_x", depth=0.0).values)
    np.testing.assert_array_equal(surface.values, finished.history("acceleration_x", at=(0.25, 4.0)).values)
    assert finished.history("velocity_x", depth=4.0).label == "base"
    assert finished.history("velocity_x", at=(0.25, 0.6)).label == "point (0.25, 0.6) m"


def test_a_history_agrees_with_the_fields(finished: Run) -> None:
    """A probe between two nodes lies between their values, at the time of every frame."""
    history = finished.history("excess_pore_pressure", depth=1.0)
    for time in finished.times[1:-1]:
        profile = finished.profile("excess_pore_pressure", time)
        at_nodes = np.interp(1.0, profile.depth, profile.values)
        sample = history.values[np.argmin(np.abs(history.time - time))]
        assert sample == pytest.approx(at_nodes, abs=0.1 + 0.05 * abs(at_nodes))


def test_ratios_are_pressures_over_the_geostatic_stress(finished: Run) -> None:
    # 1 m of loose sand, buoyant: (Gs - 1)/(1 + e) gamma_w with e = 0.8 - 0.3 Dr.
    sigma_v0 = (2.67 - 1.0) / (1.8 - 0.3 * 0.35) * 10.0
    excess = finished.history("excess_pore_pressure", depth=1.0).values
    np.testing.assert_allclose(finished.history("r_u", depth=1.0).values, excess / sigma_v0)
    np.testing.assert_allclose(finished.history("pore_pressure", depth=1.0).values, 10.0 + excess)
    sigma_v = finished.history("sigma_v_eff", depth=1.0).values
    assert sigma_v[0] == pytest.approx(sigma_v0, rel=0.05)
    np.testing.assert_allclose(finished.history("r_u_stress", depth=1.0).values, 1.0 - sigma_v / sigma_v0)
    assert np.isnan(finished.history("r_u").values).all(), "nothing stands on the surface"


def test_accelerations_are_given_in_g_on_request(finished: Run) -> None:
    plain, in_g = finished.history("acceleration_x"), finished.history("acceleration_x", unit="g")
    assert (plain.unit, in_g.unit) == ("m/s2", "g")
    np.testing.assert_allclose(plain.values, 9.81 * in_g.values)
    with pytest.raises(InvalidInput, match="must be 'm/s'"):
        finished.history("velocity_x", unit="g")


def test_an_unknown_name_is_refused_with_the_known_ones(finished: Run) -> None:
    for ask, allowed in (
        (lambda: finished.history("aceleration_x"), "did you mean 'acceleration_x'"),
        (lambda: finished.history("r_u", depth=2.0), "depth 1 m at (0.25, 3), depth 3 m"),
        (lambda: finished.history("r_u", at=(0.0, 0.0)), "name it in output.depths or output.points"),
        (lambda: finished.history("r_u", at=(0.25, 3.0), depth=1.0), "takes one of the two"),
        (lambda: finished.history("r_u", depth=1.0, stage="shakin"), "did you mean 'shaking'"),
        (lambda: finished.field("displacment"), "did you mean 'displacement'"),
        (lambda: finished.field("r_u", 50.0), "lie in [0, 0.8000"),
        (lambda: finished.field("r_u", "first"), "must be 'last'"),
        (lambda: finished.envelope("velocity"), "r_u"),
        (lambda: finished.profile("r_u", x=7.0), "[0, 0.5]"),
    ):
        with pytest.raises(InvalidInput) as caught:
            ask()
        assert allowed in str(caught.value)


def test_the_spectrum_is_that_of_the_surface_acceleration(finished: Run) -> None:
    periods = [0.0, 0.1, 0.5, 2.0]
    history = finished.history("acceleration_x", unit="g")
    expected = response_spectrum(history.values, 0.005, periods)
    np.testing.assert_allclose(finished.spectrum(periods=periods).psa_g, expected.psa_g, rtol=1e-6)
    assert finished.spectrum(periods=[0.0]).psa_g[0] == np.abs(history.values).max()
    np.testing.assert_array_equal(finished.spectrum().periods, scenes.PULSE.response_spectrum().periods)


def test_the_motion_is_kept(finished: Run) -> None:
    assert finished.motion() == scenes.PULSE


def test_stress_paths_that_were_not_kept_are_unknown(tmp_path: Path) -> None:
    spare = {"stress_paths": False, "envelopes": ["r_u"]}
    results = run(scenes.column(stages=[Gravity(), Shaking(duration=0.01)], output=spare), tmp_path)
    assert "tau_xy" not in results.history_names
    with pytest.raises(InvalidInput):
        results.history("tau_xy")
    assert results.motion() is None
    with pytest.raises(InvalidInput, match="must be one that was kept: r_u"):
        results.envelope("gamma_max")


# Fields


def test_profiles_run_down_from_the_surface(finished: Run) -> None:
    profile = finished.profile("pore_pressure", 0.0)
    np.testing.assert_allclose(profile.depth, np.arange(0.125, 4.0, 0.25))
    np.testing.assert_allclose(profile.values, 10.0 * profile.depth)
    assert (profile.time, profile.unit) == (0.0, "kPa")
    assert finished.profile("displacement", x=0.5).values.shape == (16, 2)
    assert finished.profile("displacement", x=0.5).x == pytest.approx(0.375)


def test_envelopes_bound_every_frame(finished: Run) -> None:
    for name in ("r_u", "gamma_max"):
        envelope, frames = finished.envelope(name), finished.field_series(name)
        assert (envelope >= frames.max(axis=0)).all()
        assert envelope.max() > 0.0
    assert finished.envelope("r_u").max() > finished.history("r_u", depth=1.0).values.max() * 0.9


def test_settlement_and_surface_agree(finished: Run) -> None:
    settlement, surface = finished.settlement(), finished.surface()
    assert settlement.values[0] == 0.0
    assert settlement.time[-1] == surface.time == finished.times[-1]
    np.testing.assert_allclose(surface.y, 4.0 - settlement.values[-1])
    np.testing.assert_allclose(surface.x, [0.125, 0.375] + surface.displacement[:, 0])
    np.testing.assert_allclose(finished.surface(0.0).y, 4.0)


# Summing up


def test_the_summary_is_a_dict_and_a_page(finished: Run) -> None:
    summary = finished.summary()
    assert isinstance(summary, Summary)
    shaking = summary["shaking"]
    assert shaking["steps"] == finished.accounts()["steps"]
    peak = np.abs(finished.history("acceleration_x", unit="g").values).max()
    assert shaking["peak surface acceleration, g"] == peak
    assert 0.0 < shaking["the same below 10 Hz, g"] <= 1.05 * peak
    assert shaking["largest r_u"]["depth 1 m"] == finished.history("r_u", depth=1.0).values.max()
    assert "surface" not in shaking["largest r_u"]
    assert shaking["counts"]["base_calls"] == shaking["steps"]
    # Every stage has its own counts.
    for stage in ("gravity", "shaking"):
        assert summary[stage]["counts"]["steps"] == summary[stage]["steps"] > 0
    assert summary["gravity"]["counts"]["base_calls"] == 0
    assert "base_calls" not in str(Summary(gravity=summary["gravity"]))
    assert set(summary["pore pressure coefficient B"]) == {"loose", "dense"}
    text = str(summary)
    for part in ("status", "complete", "time step limited by", "wall time", "base_calls", "depth 3 m"):
        assert part in text


def test_csv_holds_every_history(finished: Run, tmp_path: Path) -> None:
    path = tmp_path / "histories.csv"
    finished.to_csv(path)
    with path.open(newline="", encoding="utf-8") as file:
        header, *rows = csv.reader(file)
    assert len(header) == 1 + len(finished.history_names) * len(finished.probes)
    values = np.array(rows, dtype=float)
    history = finished.history("tau_xy", depth=3.0)
    np.testing.assert_array_equal(values[:, header.index("tau_xy (kPa) depth 3 m")], history.values)
    np.testing.assert_array_equal(values[:, 0], history.time)
    with pytest.raises(InvalidInput, match="cannot be written"):
        finished.to_csv(tmp_path / "none" / "histories.csv")


# Files that are no results


def test_a_folder_without_results_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InvalidInput, match="must contain a results"):
        load(tmp_path)
    (tmp_path / FILE_NAME).write_text("not HDF5")
    with pytest.raises(InvalidInput, match="must be a sound file"):
        load(tmp_path)


def test_another_layout_is_refused(finished: Run, tmp_path: Path) -> None:
    shutil.copy(finished.path, tmp_path / FILE_NAME)
    with h5py.File(tmp_path / FILE_NAME, "r+") as file:
        file.attrs["format_version"] = FORMAT_VERSION + 1
    with pytest.raises(InvalidInput, match="format_version"):
        load(tmp_path)
