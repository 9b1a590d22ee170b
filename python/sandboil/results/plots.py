"""Pictures of a run: seepage, and the motion of the surface, pore pressure, the column, and the soil.

Every function gives a matplotlib figure; :func:`plot` writes them all. Another code's results in CSV may be
drawn over them; :class:`Reference` lists the columns.
"""

from __future__ import annotations

import math
import os
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import shapely

from .._errors import InvalidInput
from .._style import DPI, INPUT, OURS, REFERENCE, new_figure, styled
from .._types import Floats
from ..core.quantities import CONSTANT_FORCES
from ..motion import Motion
from ..motion._motion import SIGNIFICANT
from ..motion._series import butterworth
from ..scene.stages import RunOut
from .layout import Stage
from .reader import Run
from .records import interval_of
from .reference import Reference, column_of
from .summary import PGA_CORNER, PGA_ORDER

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

FOLDER = "plots"

# Colour of air and of water, and of conditions (Okabe and Ito 2008, without the phreatic line's and black).
_WATER = ("#F5F0E6", "#9CCBEB")
_CONDITIONS = ("#0072B2", "#009E73", "#CC79A7", "#E69F00", "#F0E442")
# Lines of equal head at most.
_HEAD_LINES = 12
# Points of a picture's lattice per spacing, and nodes that each is read from: those of the cells around it.
_RASTER = 3
_NEIGHBOURS = 12

_COLUMN_TIMES = 6
# Width of the sway over the height of the column in its picture, before the factor is rounded.
_SWAY_SHARE = 0.6


def plot(
    run: Run,
    folder: str | os.PathLike[str] | None = None,
    *,
    reference: Reference | None = None,
    stage: str | None = None,
) -> list[Path]:
    """Write every picture that the run has data for as PNG, and return the paths.

    Parameters
    ----------
    folder : where to; default `plots` in the run's own
    reference : results of another code to draw over those of the run
    stage : a stage in which the ground moves, default the last

    Raises
    ------
    InvalidInput : a run without shaking and without seepage, a folder that cannot be written
    """
    with styled():
        figures = {"seepage": seepage(run)} if run.discharge else {}
        if _shaken_stages(run) or stage is not None or not figures:
            figures |= _shaking_figures(run, reference, _shaken_stage(run, stage))
        target = run.path.parent / FOLDER if folder is None else Path(folder)
        paths = []
        try:
            target.mkdir(parents=True, exist_ok=True)
            for name, figure in figures.items():
                paths.append(target / f"{name}.png")
                figure.savefig(paths[-1], dpi=DPI)
        except OSError as error:
            raise InvalidInput("folder", str(target), f"must be writable: {error}") from error
    return paths


def _shaking_figures(run: Run, reference: Reference | None, stage: str) -> dict[str, Figure]:
    """Every picture of a shaking stage that the run has data for."""
    if _is_run_out(run, stage):
        return {"run_out": run_out(run, stage=stage), "energy": energy(run, stage=stage)}
    figures = {"surface": surface(run, reference=reference, stage=stage)}
    if run.scene.water is not None and run.scene.output.depths:
        figures["pore_pressure"] = pore_pressure(run, reference=reference, stage=stage)
    figures["column"] = column(run, stage=stage)
    if not run.scene.outline.is_level:
        figures["section"] = section(run, stage=stage)
    figures["energy"] = energy(run, stage=stage)
    if run.scene.output.stress_paths and run.scene.output.depths:
        figures["stress_paths"] = stress_paths(run, reference=reference, stage=stage)
    return figures


def _shaken_stages(run: Run) -> list[str]:
    """Names of the stages begun in which the ground moves."""
    return [
        name
        for name, kind in zip(run.scene.stage_names, run.scene.stages, strict=True)
        if kind.moves and name in run.stages
    ]


def _shaken_stage(run: Run, stage: str | None) -> str:
    """The stage asked for, or the last, if it is a shaking one with histories."""
    shaken = _shaken_stages(run)
    if stage is None and shaken:
        return shaken[-1]
    if stage not in shaken:
        raise InvalidInput(
            "stage", stage, f"must be a shaking stage of the run: {', '.join(shaken) or 'none'}"
        )
    return stage


def _is_run_out(run: Run, stage: str) -> bool:
    return isinstance(run.scene.stages[run.scene.stage_names.index(stage)], RunOut)


def run_out(run: Run, *, stage: str | None = None) -> Figure:
    """Draw a run-out: the ground at the start, at the largest velocity, and at the end."""
    stage = _shaken_stage(run, stage)
    history, times = run.energy(stage), run.frame_times(stage)
    fastest = float(history["time"][np.argmax(history["kinetic"])])
    outline, (x0, _, x1, _) = run.scene.outline, run.scene.bounds
    edge = np.vstack([outline.base, outline.surface[::-1], outline.base[:1]])
    moments = (float(times[0]), fastest, float(times[-1]))
    moved = [run.position + run.field("displacement", time, stage=stage) for time in moments]
    wet = run.scene.water is not None
    name, label = ("pore_pressure", "pore pressure, kPa") if wet else ("velocity", "speed, m/s")
    values = [run.field(name, time, stage=stage) for time in moments]
    if not wet:
        values = [np.hypot(velocity[:, 0], velocity[:, 1]) for velocity in values]
    low, top = (extreme(value) for extreme, value in ((np.min, values), (np.max, values)))
    # Particles far ahead of the front are outside the picture, which would otherwise shrink.
    front = np.quantile(moved[-1][:, 0], (0.002, 0.998))
    left, right = min(x0, float(front[0])), max(x1, float(front[1]))
    bottom, height = outline.base[:, 1].min(), np.ptp(edge[:, 1])
    panel = float(np.clip(10.0 * height / (right - left), 0.8, 4.0))
    figure = new_figure(10.0, 3.0 * (panel + 0.6))
    panels = figure.subplots(3, 1, sharex=True, sharey=True)
    for axes, time, places, value in zip(panels, moments, moved, values, strict=True):
        image = axes.scatter(*places.T, c=value, s=5.0, cmap="viridis", vmin=low, vmax=top, linewidths=0.0)
        axes.plot(*edge.T, color="black", lw=0.8, label="at rest")
        axes.set(ylabel="y, m", aspect="equal", xlim=(left, right), ylim=(bottom, bottom + 1.05 * height))
        axes.set_title(f"{time:.4g} s", loc="left", fontsize=9)
    panels[-1].set_xlabel("x, m")
    figure.colorbar(image, ax=list(panels), label=label, shrink=0.8, pad=0.01)
    panels[0].legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), fontsize=7)
    return figure


def seepage(run: Run) -> Figure:
    """The water at the end of a seepage stage: heads, phreatic line, saturation, and discharges."""
    from matplotlib.colors import LinearSegmentedColormap
    from matplotlib.patches import Polygon as Patch
    from matplotlib.ticker import MaxNLocator

    water, stage = run.scene.water, run.scene.seepage
    if water is None or stage is None or not run.discharge:
        known = ", ".join(run.stages) or "none"
        raise InvalidInput("stage", "seepage", f"must be a stage of the run: {known}")
    x, y, head = _raster(run, run.seepage_field("head"))
    _, _, saturation = _raster(run, run.seepage_field("saturation"))
    figure = new_figure(*_size_of(run, len(stage.conditions)))
    axes = figure.subplots()
    edge = shapely.get_coordinates(run.scene.section.exterior)
    section = axes.add_patch(Patch(edge, facecolor="none", edgecolor="black", lw=0.8))
    colours = LinearSegmentedColormap.from_list("water", _WATER)
    shading = axes.pcolormesh(
        x, y, saturation, shading="nearest", cmap=colours, vmin=0.0, vmax=1.0, rasterized=True
    )
    figure.colorbar(shading, ax=axes, label="degree of saturation", shrink=0.8, pad=0.01)
    shading.set_clip_path(section)
    levels = MaxNLocator(_HEAD_LINES).tick_values(float(np.nanmin(head)), float(np.nanmax(head)))
    heads = axes.contour(x, y, head, levels=levels, colors="black", linewidths=0.5, linestyles="solid")
    heads.set_clip_path(section)
    axes.clabel(heads, fontsize=6, fmt="%g")
    phreatic = axes.contour(x, y, head - y[:, None], levels=[0.0], colors=REFERENCE, linewidths=1.8)
    phreatic.set_clip_path(section)
    for region in run.scene.regions:
        axes.plot(*region.geometry.exterior.xy, color="black", lw=0.3)
    axes.plot([], [], color="black", lw=0.5, label="total head, m")
    axes.plot([], [], color=REFERENCE, lw=1.8, label="phreatic line, p = 0")
    time = float(run.accounts("seepage")[Stage.TIME])
    for i, (condition, (_, inflow)) in enumerate(zip(stage.conditions, run.discharge, strict=True)):
        line = np.asarray(shapely.get_coordinates(run.scene.condition_line(condition)))
        colour = _CONDITIONS[i % len(_CONDITIONS)]
        label = f"{condition.described(time)}: {inflow:+.3g} m$^3$/s per m"
        axes.plot(*line.T, color=colour, lw=3.0, solid_capstyle="butt", label=label)
    axes.set(xlabel="x, m", ylabel="y, m", aspect="equal")
    axes.grid(visible=False)
    entering = sum(max(inflow, 0.0) for _, inflow in run.discharge)
    when = "steady state" if stage.duration is None else f"after {time:.4g} s"
    figure.suptitle(f"seepage, {when}: {entering:.3g} m$^3$/s per m enter", fontsize=9)
    title = "discharges are positive where water comes in"
    figure.legend(loc="outside lower center", ncols=2, fontsize=7, title=title, title_fontsize=7)
    # The layout needs the sizes of tick labels, which are known after a first drawing.
    figure.draw_without_rendering()
    return figure


def _size_of(run: Run, conditions: int) -> tuple[float, float]:
    """Width and height of a picture of the section with a legend of so many conditions, inches."""
    x0, y0, x1, y1 = run.scene.bounds
    steepness = (y1 - y0) / (x1 - x0)
    height = float(np.clip(8.5 * steepness, 1.5, 6.0))
    # Room for the colour bar, and for the legend below.
    width = float(np.clip(height / steepness + 1.5, 5.0, 10.0))
    return width, height + 1.3 + 0.1 * conditions


def _raster(run: Run, values: Floats) -> tuple[Floats, Floats, Floats]:
    """x (m,), y (n,) and values (n, m) of a field of the nodes on a fine lattice; nan outside the section.

    It extends to the edges, which no node reaches.
    """
    # Imported where it is used: that takes a quarter of a second.
    from scipy.interpolate import RBFInterpolator

    x0, y0, x1, y1 = run.scene.bounds
    step = run.scene.spacing / _RASTER
    x, y = (np.linspace(a, b, math.ceil((b - a) / step) + 1) for a, b in ((x0, x1), (y0, y1)))
    raster = np.full((len(y), len(x)), np.nan)
    points = np.stack(np.meshgrid(x, y), axis=-1)
    # Half a cell more, so that lines are cut by the edge itself.
    reach = shapely.buffer(run.scene.section, 0.5 * run.scene.spacing)
    inside = shapely.intersects_xy(reach, points[..., 0], points[..., 1])
    # Without a linear part, which a single column of nodes does not determine.
    field = RBFInterpolator(run.position, values, neighbors=_NEIGHBOURS, kernel="linear", degree=0)
    raster[inside] = field(points[inside])
    return x, y, raster


def surface(run: Run, *, reference: Reference | None = None, stage: str | None = None) -> Figure:
    """Horizontal acceleration of the surface, and its 5 % response spectrum beside the input's."""
    stage = _shaken_stage(run, stage)
    history = run.history("acceleration_x", stage=stage, unit="g")
    motion = run.motion(stage)
    figure = new_figure(11.0, 4.5)
    panels = figure.subplot_mosaic("AC;BC", width_ratios=[1.4, 1.0], height_ratios=[2.0, 1.0])
    top, bottom, right = panels["A"], panels["B"], panels["C"]

    label = f"surface, peak {np.abs(history.values).max():.3f} g"
    dt = interval_of(history)
    if 0.5 / dt > PGA_CORNER:
        smooth = np.abs(butterworth(history.values, dt, None, PGA_CORNER, PGA_ORDER)).max()
        label += f" (below {PGA_CORNER:g} Hz: {smooth:.3f} g)"
    top.plot(history.time, history.values, color=OURS, label=label)
    if reference is not None:
        values = column_of(reference.histories, "acc_surface_g")
        label = f"reference, peak {np.abs(values).max():.3f} g"
        top.plot(
            column_of(reference.histories, "time_s"), values, color=REFERENCE, lw=0.7, ls="--", label=label
        )
    top.set(ylabel="horizontal acceleration, g", xlim=(0.0, history.time[-1]))
    top.legend(loc="upper right")
    if motion is not None:
        label = f"{motion.kind} motion, peak {motion.pga_g:.3f} g"
        bottom.plot(motion.time, motion.acceleration_g, color=INPUT, lw=0.7, label=label)
        bottom.legend(loc="upper right")
    bottom.set(xlabel="time, s", ylabel="acceleration, g", xlim=(0.0, history.time[-1]))

    spectrum = run.spectrum(stage=stage)
    right.semilogx(spectrum.periods, spectrum.psa_g, color=OURS, label="surface", zorder=3)
    if motion is not None:
        shaken = motion.response_spectrum()
        right.semilogx(shaken.periods, shaken.psa_g, color=INPUT, label=f"{motion.kind} motion")
    if reference is not None:
        periods = column_of(reference.spectrum, "period_s")
        values = column_of(reference.spectrum, "psa_surface_g_5pct")
        right.semilogx(periods, values, color=REFERENCE, ls="--", label="reference, surface")
    right.set(
        xlabel="period, s",
        ylabel=f"pseudo-acceleration, {100 * spectrum.damping:g} % damping, g",
        xlim=(spectrum.periods[0], spectrum.periods[-1]),
        ylim=(0.0, None),
    )
    right.xaxis.set_major_formatter("{x:g}")
    right.legend(loc="upper right")
    return figure


def pore_pressure(run: Run, *, reference: Reference | None = None, stage: str | None = None) -> Figure:
    """Excess pore pressure ratio over time at the output depths, one panel each."""
    stage = _shaken_stage(run, stage)
    depths = run.scene.output.depths
    figure = new_figure(8.0, 1.0 + 1.7 * len(depths))
    panels = figure.subplots(len(depths), 1, sharex=True, squeeze=False)[:, 0]
    for axes, depth in zip(panels, depths, strict=True):
        history = run.history("r_u", depth=depth, stage=stage)
        axes.plot(history.time, history.values, color=OURS, label="sandboil", zorder=3)
        name = f"ru_{depth:g}m"
        if reference is not None and name in reference.histories:
            time = column_of(reference.histories, "time_s")
            axes.plot(time, reference.histories[name], color=REFERENCE, ls="--", label="reference", zorder=4)
        axes.axhline(1.0, color="black", lw=0.6, ls=":")
        axes.set(ylabel="$r_u$", ylim=(min(0.0, history.values.min()), max(1.1, history.values.max())))
        axes.set_title(f"{depth:g} m below the surface", loc="left", fontsize=9)
    panels[0].legend(loc="upper right", bbox_to_anchor=(1.0, 0.92))
    panels[-1].set(xlabel="time, s", xlim=(0.0, history.time[-1]))
    figure.suptitle("Excess pore pressure over initial vertical effective stress", fontsize=10)
    return figure


def column(run: Run, *, stage: str | None = None) -> Figure:
    """r_u over depth and time in the mid column (with water), and the column's sway at several times."""
    stage = _shaken_stage(run, stage)
    times = run.frame_times(stage)
    wet = run.scene.water is not None
    figure = new_figure(9.5 if wet else 4.5, 5.2)
    if wet:
        left, right = figure.subplots(1, 2, width_ratios=[1.7, 1.0])
        _draw_map(run, stage, times, left)
    else:
        right = figure.subplots()
    _draw_sway(run, stage, times, right)
    return figure


def section(run: Run, *, stage: str | None = None) -> Figure:
    """The section: outline at rest, and displacement of every particle at the end."""
    stage = _shaken_stage(run, stage)
    outline, (x0, y0, x1, y1) = run.scene.outline, run.scene.bounds
    displacement = run.field("displacement", stage=stage)
    moved = run.position + displacement
    width = 10.0
    height = float(np.clip(width * (y1 - y0) / (x1 - x0), 2.0, width))
    figure = new_figure(width, height + 1.0)
    axes = figure.subplots()
    edge = np.vstack([outline.base, outline.surface[::-1], outline.base[:1]])
    size = 100.0 * np.hypot(displacement[:, 0], displacement[:, 1])
    image = axes.scatter(moved[:, 0], moved[:, 1], c=size, s=6.0, cmap="viridis", linewidths=0.0)
    figure.colorbar(image, ax=axes, label="displacement, cm")
    axes.plot(*edge.T, color="black", lw=0.8, label="at rest")
    axes.plot(*np.array([(p.x, p.y) for p in run.probes]).T, "k+", ms=6.0, label="histories")
    axes.set(xlabel="x, m", ylabel="y, m", aspect="equal")
    axes.set_title(f"displacement at {run.frame_times(stage)[-1]:.4g} s", loc="left", fontsize=9)
    # Above the frame, since a section may fill any of its corners.
    axes.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=2, fontsize=7)
    return figure


def energy(run: Run, *, stage: str | None = None) -> Figure:
    """Energy that entered the section, and its use, over time; kinds that stay zero are left out."""
    stage = _shaken_stage(run, stage)
    history = run.energy(stage)
    figure = new_figure(8.0, 4.5)
    axes = figure.subplots()
    dissipated = "velocity filter and Rayleigh damping"
    if _is_run_out(run, stage):
        dissipated = "velocity filter, viscosity and edges"
    # The work of gravity and that of the stress at rest cancel; alone they are far larger than the rest.
    parts = {
        "inflow": history["base"] + history["sides"],
        "motion": history["kinetic"],
        "soil": history["stress"] - sum(history[name] for name in CONSTANT_FORCES),
        "pore water": history["water"],
        dissipated: history["damping"],
        "local damping": history["local_damping"],
    }
    for (name, values), colour in zip(parts.items(), ("black", *_CONDITIONS), strict=True):
        if np.any(values != 0.0):
            axes.plot(history["time"], values, color=colour, label=name, lw=1.6 if name == "inflow" else 1.0)
    axes.set(xlabel="time, s", ylabel="energy, kJ per m", xlim=(0.0, history["time"][-1]))
    axes.legend(loc="best")
    return figure


def neighbourhood(place: Floats, speed: Floats, stress: Floats, title: str, path: Path) -> None:
    """Draw the nodes around the first of `place` (n, 2), m, where a run diverged, into a PNG.

    With their speed (m/s, n) and vertical effective stress (kPa, n); values that are not finite are crosses.
    Raises :class:`OSError`.
    """
    with styled():
        figure = new_figure(10.0, 4.8)
        panels = figure.subplots(1, 2, sharex=True, sharey=True)
        labels = ("speed, m/s", "vertical effective stress, kPa")
        for axes, values, label in zip(panels, (speed, stress), labels, strict=True):
            finite = np.isfinite(values)
            # Diverging values span decades; a logarithmic scale shows their neighbours, too.
            norm = "log" if values is speed and np.any(speed[finite] > 0.0) else "linear"
            image = axes.scatter(*place[finite].T, c=values[finite], norm=norm, cmap="viridis", s=60.0)
            figure.colorbar(image, ax=axes, label=label)
            axes.plot(*place[0], "o", mfc="none", mec=REFERENCE, mew=1.5, ms=13.0, label="diverged")
            axes.plot(*place[~finite].T, "x", color=REFERENCE, ms=7.0, label="not finite")
            (x, y), reach = place[0], 1.1 * np.abs(place - place[0]).max()
            axes.set(xlim=(x - reach, x + reach), ylim=(y - reach, y + reach), aspect="equal")
            axes.set(xlabel="x at rest, m", ylabel="y at rest, m")
        figure.suptitle(title, fontsize=9)
        figure.legend(*panels[0].get_legend_handles_labels(), loc="outside lower center", ncols=2)
        figure.savefig(path, dpi=DPI)


def _draw_map(run: Run, stage: str, times: Floats, axes: Axes) -> None:
    profile = run.profile("sigma_v_eff", stage=stage)
    nodes = run.column(profile.x)
    ratio = run.field_series("r_u", stage=stage)[:, nodes]
    image = axes.pcolormesh(
        times, profile.depth, ratio.T, shading="nearest", cmap="viridis", vmin=0.0, vmax=1.0, rasterized=True
    )
    axes.figure.colorbar(image, ax=axes, label="$r_u$", extend="max")
    for below in run.scene.output.depths:
        axes.axhline(below, color="white", lw=0.6, ls=":")
    axes.set(xlabel="time, s", ylabel="depth below the surface, m", ylim=(_thickness(run), 0.0))
    axes.set_xlim(times[0], times[-1])
    axes.set_title(f"excess pore pressure ratio at x = {profile.x:g} m", loc="left", fontsize=9)
    axes.grid(visible=False)


def _draw_sway(run: Run, stage: str, times: Floats, axes: Axes) -> None:
    """Horizontal displacement against the base, cm, at times spread over strong shaking, and at the end."""
    from matplotlib import colormaps

    nodes = run.column()
    profile = run.profile("displacement", stage=stage)
    begin, end = _strong_part(run.motion(stage), times)
    wanted = [*np.linspace(begin, end, _COLUMN_TIMES), times[-1]]
    frames = sorted({int(np.argmin(np.abs(times - time))) for time in wanted})
    displacement = run.field_series("displacement", stage=stage)[:, nodes, 0]
    sway = 100.0 * (displacement - displacement[:, -1:])[frames]
    colours = colormaps["plasma"](np.linspace(0.0, 0.85, len(frames)))
    for frame, values, colour in zip(frames, sway, colours, strict=True):
        axes.plot(values, profile.depth, color=colour, label=f"{times[frame]:.1f} s")
    height = profile.depth[-1] - profile.depth[0]
    extent = float(np.ptp(sway)) / 100.0
    if extent > 0.0:
        factor = _rounded(_SWAY_SHARE * height / extent)
        # A centimetre of sway takes as much paper as `factor` centimetres of depth.
        axes.set_aspect(100.0 / factor)
        axes.set_title(f"sway, drawn {factor:g} times larger", loc="left", fontsize=9)
    label = "depth below the surface, m"
    axes.set(xlabel="displacement against the base, cm", ylabel=label, ylim=(_thickness(run), 0.0))
    axes.legend(loc="lower left", fontsize=7, title="time", title_fontsize=7)


def _thickness(run: Run) -> float:
    """Of the mid column, m: from the surface's history to the base's."""
    surface, base = run.probes[:2]
    return surface.y - base.y


def _strong_part(motion: Motion | None, times: Floats) -> tuple[float, float]:
    """Times between which most of the shaking happens, s; without a motion all."""
    if motion is None or motion.arias == 0.0:
        return float(times[0]), float(times[-1])
    share = np.cumsum(motion.acceleration_g**2)
    begin, end = np.interp(SIGNIFICANT, share / share[-1], motion.time)
    return float(begin), min(float(end), float(times[-1]))


def _rounded(factor: float) -> float:
    """The largest of 1, 2, 5, 10, 20, ... that does not exceed `factor`; at least 1."""
    if factor < 1.0:
        return 1.0
    decade = 10.0 ** math.floor(math.log10(factor))
    return max(step * decade for step in (1.0, 2.0, 5.0) if step * decade <= factor)


def stress_paths(run: Run, *, reference: Reference | None = None, stage: str | None = None) -> Figure:
    """Shear stress against vertical effective stress and against shear strain at the output depths."""
    stage = _shaken_stage(run, stage)
    depths = run.scene.output.depths
    figure = new_figure(9.0, 0.6 + 2.5 * len(depths))
    panels = figure.subplots(len(depths), 2, squeeze=False)
    for (left, right), depth in zip(panels, depths, strict=True):
        tau, sigma, gamma = (
            run.history(name, depth=depth, stage=stage).values
            for name in ("tau_xy", "sigma_v_eff", "gamma_xy")
        )
        if reference is not None and f"tau_kPa_{depth:g}m" in reference.stress_strain:
            their_tau, their_sigma, their_gamma = (
                column_of(reference.stress_strain, f"{name}_{depth:g}m")
                for name in ("tau_kPa", "sv_eff_kPa", "gamma")
            )
            left.plot(their_sigma, their_tau, color=REFERENCE, lw=0.6, label="reference")
            right.plot(100.0 * their_gamma, their_tau, color=REFERENCE, lw=0.6, label="reference")
        left.plot(sigma, tau, color=OURS, lw=0.7, label="sandboil")
        right.plot(100.0 * gamma, tau, color=OURS, lw=0.7, label="sandboil")
        left.set(xlabel="vertical effective stress, kPa", ylabel="shear stress, kPa", xlim=(0.0, None))
        right.set(xlabel="shear strain, %", ylabel="shear stress, kPa")
        left.set_title(f"{depth:g} m below the surface", loc="left", fontsize=9)
    panels[0, 1].legend(loc="upper left")
    return figure
