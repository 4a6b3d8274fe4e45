"""Pictures of the report, drawn by matplotlib (the extra `report`)."""

from __future__ import annotations

import io
import re
from collections.abc import Sequence
from html import escape
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..checks import About, Check, Curve, Maps, Plot
from ..styles import INK, STYLES
from .section import Section

COLOURS = (INK, "#b8862b", "#8a8a8a", "#9066c0", "#5f9e33", "#d0552b", "#2a9a9a", "#3c78b4")
# Part of a label -> colour of the curve; the first one counts, so that RK45 comes before RK4.
SOLVERS = {name: style.colour for name, style in STYLES.items()}
SOLVERS["RK4"] = SOLVERS["ExplicitRungeKutta4"]
STYLE: Any = {
    "svg.fonttype": "none",
    "font.family": "sans-serif",
    "text.color": INK,
    "axes.edgecolor": INK,
    "axes.labelcolor": INK,
    "axes.titlesize": "medium",
    "xtick.color": INK,
    "ytick.color": INK,
    "grid.color": "#888888",
    "grid.linewidth": 0.3,
    "axes.facecolor": "none",
    "legend.framealpha": 0.0,
    "image.composite_image": False,
}
ELEMENT = re.compile(r' id="[A-Za-z0-9.]+_\d+"')  # names that matplotlib gives in every picture
POINTS = 2000  # of a curve at most, about
MARKED = 80  # points of a line at most, each of which shows its marker
SIZES = dict.fromkeys("x+1234*", 6) | {".": 7}  # of markers of thin strokes, and of small ones; 4 of others
FEW = 8  # places on an axis, each of which has its number
WIDEST = 1e6  # margins beyond it are drawn at this one
MARKS = {About.FMU: ("o", "#2f7fd1"), About.FORMULAS: ("x", "#8a8a8a"), About.TIMES: ("^", "#d0552b")}


def svg(plot: Plot | Maps) -> str:
    """Return a picture as an element of a page; it is the same for the same data."""
    drawn = _drawn(plot, "svg", {"svg.hashsalt": plot.title}, {"Date": None, "Creator": None})
    return _element(drawn, plot.title)


def png(plot: Plot | Maps) -> bytes:
    """Return a picture as a PNG file."""
    return _drawn(plot, "png", {"savefig.facecolor": "white"}, {"Software": None})


def _drawn(plot: Plot | Maps, kind: str, style: dict[str, Any], metadata: dict[str, Any]) -> bytes:
    with _pyplot().rc_context(STYLE | style):
        return _saved(_maps(plot) if isinstance(plot, Maps) else _plot(plot), kind, metadata)


def _element(data: bytes, name: str) -> str:
    """Return a picture without what stands before it, with the name that a screen reader says."""
    text = data.decode("utf-8")
    text = ELEMENT.sub("", text[text.index("<svg") :]).replace(INK, "currentColor")
    return text.replace("<svg", f'<svg role="img" aria-label="{escape(name)}"', 1)


def _pyplot() -> Any:
    import matplotlib as mpl

    mpl.use("Agg")
    from matplotlib import pyplot

    return pyplot


def _saved(figure: Any, kind: str, metadata: dict[str, Any]) -> bytes:
    buffer = io.BytesIO()
    figure.savefig(buffer, format=kind, metadata=metadata, transparent=kind == "svg")
    _pyplot().close(figure)
    return buffer.getvalue()


def _plot(plot: Plot) -> Any:
    panels = 2 if plot.below else 1
    figure, axes = _pyplot().subplots(
        panels,
        1,
        figsize=(9.0, 4.4 if panels == 1 else 6.4),
        dpi=110,
        layout="constrained",
        sharex=True,
        squeeze=False,
        height_ratios=(3, 2)[:panels],
    )
    upper, lower = axes[0, 0], axes[-1, 0]
    if plot.shade is not None:
        x, y, values = plot.shade
        shaded = np.ma.masked_equal(np.asarray(values, dtype=float), 0.0)  # 0 stays the colour of the page
        upper.pcolormesh(
            x, y, shaded, cmap="Greys", vmin=0.0, vmax=2.0, alpha=0.5, shading="nearest", rasterized=True
        )
    _curves(upper, plot.curves, plot.logarithmic)
    upper.set(title=plot.title, ylabel=plot.y_label)
    if plot.y_range is not None:
        upper.set_ylim(*plot.y_range)
    if plot.below:
        labels_above = {curve.label for curve in plot.curves}
        told = {curve.label for curve in plot.below} <= labels_above
        _curves(
            lower, plot.below, plot.logarithmic.replace("y", "") + plot.below_logarithmic, legend=not told
        )
        lower.set_ylabel(plot.below_label)
    lower.set_xlabel(plot.x_label)
    return figure


COLUMNS = 4  # of panels


def _maps(plot: Maps) -> Any:
    """Return panels of cells, which are as wide and high as each other whatever lies between their coordinates."""
    pyplot = _pyplot()
    rows = -(-len(plot.panels) // COLUMNS)
    figure = pyplot.figure(figsize=(9.0, 4.2 * rows), dpi=110, layout="constrained")
    blocks = figure.subfigures(2, 1)
    halves = (
        ([panel.values for panel in plot.panels], plot.label_of_values, plot.span_of_values),
        ([panel.others for panel in plot.panels], plot.label_of_others, plot.span_of_others),
    )
    for block, (panels, label, span) in zip(blocks, halves, strict=True):
        block.set_facecolor("none")
        axes = block.subplots(rows, COLUMNS, sharex=True, sharey=True, squeeze=False)
        for axis in axes.flat[len(plot.panels) :]:
            axis.set_visible(False)
        for axis, panel, values in zip(axes.flat, plot.panels, panels, strict=False):
            cells = _cells(axis, np.asarray(values, dtype=float), span)
            axis.set_title(panel.title, fontsize="small")
            axis.set_xticks(range(0, len(plot.x), 3), [f"{value:.2g}" for value in plot.x[::3]])
            axis.set_yticks(range(0, len(plot.y), 2), [f"{value:g}" for value in plot.y[::2]])
            axis.tick_params(labelsize="small")
        block.supxlabel(plot.x_label, fontsize="medium", color=INK)
        block.supylabel(plot.y_label, fontsize="medium", color=INK)
        block.colorbar(cells, ax=axes, label=label, fraction=0.03)
    figure.suptitle(plot.title, fontsize="medium")
    return figure


def _cells(axis: Any, values: NDArray[np.float64], span: tuple[float, float]) -> Any:
    """Draw a panel; what is beyond the span, or no number, is crossed out."""
    lost = ~(values <= span[1])
    shown = np.ma.masked_array(np.maximum(values, span[0]), lost)
    axis.plot(*np.nonzero(lost)[::-1], "x", color=INK, markersize=4)
    norm = _pyplot().matplotlib.colors.LogNorm(*span)
    return axis.pcolormesh(
        np.arange(values.shape[1]),
        np.arange(values.shape[0]),
        shown,
        cmap="viridis",
        norm=norm,
        rasterized=True,
    )


def _curves(axes: Any, curves: Sequence[Curve], logarithmic: str, legend: bool = True) -> None:
    colours: dict[str, str] = {}
    for i, curve in enumerate(curves):
        colours[curve.label] = colours[curve.like] if curve.like else _colour(curve.label, i)
        every = max(1, len(np.asarray(curve.x)) // POINTS)
        x, y = np.asarray(curve.x)[::every], np.asarray(curve.y)[::every]
        axes.plot(
            x,
            y,
            color=colours[curve.label],
            linestyle=curve.line or "none",
            marker=curve.marker,
            markersize=SIZES.get(curve.marker, 4),
            # Markers of a curve of many points stand a tenth of the picture apart, those of the next one beside them.
            markevery=(0.1 * (i % 8) / 8, 0.1) if curve.line and len(x) > MARKED else None,
            linewidth=1.3,
            zorder=2 if curve.line else 3,  # points lie upon lines
            label=curve.label,
        )
    for axis in logarithmic:
        getattr(axes, f"set_{axis}scale")("log")
    few = np.unique(np.concatenate([np.asarray(curve.x, dtype=float) for curve in curves]))
    if "x" in logarithmic and len(few) <= FEW and few[-1] < 30 * few[0]:  # the powers of ten say too little
        axes.set_xticks(few, [f"{x:.3g}" for x in few])
        axes.minorticks_off()
    if legend and any(curve.label for curve in curves):
        axes.legend(fontsize="small", loc="upper left", bbox_to_anchor=(1.01, 1.0))
    axes.grid(True)


def _colour(label: str, position: int) -> str:
    """Return the colour of a curve: that of the exact answer, of the solver in its label, or by its position."""
    if label.startswith("exact"):
        return INK
    found = [colour for name, colour in SOLVERS.items() if name in label]
    return found[0] if found else COLOURS[position % len(COLOURS)]


def margins(sections: Sequence[Section]) -> str:
    """Return the picture of all margins by study, as an element of a page."""
    pyplot = _pyplot()
    with pyplot.rc_context(STYLE | {"svg.hashsalt": "margins"}):
        figure, axes = pyplot.subplots(figsize=(9.0, 0.5 * len(sections) + 1.2), layout="constrained")
        shown = [section for section in sections if section.checks]
        for i, section in enumerate(shown):
            for about, (marker, colour) in MARKS.items():
                rows = [check for check in section.checks if check.about is about]
                # Rows of equal margins lie on each other but for a shift that their order gives.
                shift = 0.3 * np.sin(2.4 * np.arange(len(rows)))
                axes.plot([_margin(row) for row in rows], i + shift, marker, color=colour, markersize=3.5)
        axes.set_xscale("log")
        axes.axvline(1.0, color=INK, linewidth=1.0)
        axes.set_yticks(range(len(shown)), [section.short_title for section in shown])
        axes.set(xlabel="margin: bound/measured, or measured/bound of a lower bound; a row left of 1 fails")
        axes.invert_yaxis()
        axes.grid(True, axis="x")
        return _element(
            _saved(figure, "svg", {"Date": None, "Creator": None}), "Margins of all rows by study"
        )


def _margin(check: Check) -> float:
    return float(np.clip(np.nan_to_num(check.margin, nan=1e-2), 1e-2, WIDEST)) if check.holds else 0.5
