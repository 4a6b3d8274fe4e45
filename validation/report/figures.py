"""Pictures of the report, drawn by matplotlib (the extra `report`)."""

from __future__ import annotations

import io
import re
from typing import Any

from ..checks import Plot

INK = "#010203"  # of axes and text; in a page it is the colour of the text around the picture
COLOURS = (INK, "#2f7fd1", "#d0552b", "#5f9e33", "#9066c0", "#8a8a8a", "#c49a00", "#2a9a9a")
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
}
ELEMENT = re.compile(r' id="[A-Za-z0-9]+_\d+"')  # names that matplotlib gives in every picture


def svg(plot: Plot) -> str:
    """Return a picture as an element of a page; it is the same for the same data."""
    data = _draw(plot, "svg", {"svg.hashsalt": plot.title}, {"Date": None, "Creator": None})
    text = data.decode("utf-8")
    return ELEMENT.sub("", text[text.index("<svg") :]).replace(INK, "currentColor")


def png(plot: Plot) -> bytes:
    """Return a picture as a PNG file."""
    return _draw(plot, "png", {"savefig.facecolor": "white"}, {"Software": None})


def _draw(plot: Plot, kind: str, style: dict[str, Any], metadata: dict[str, Any]) -> bytes:
    import matplotlib as mpl

    mpl.use("Agg")
    from matplotlib import pyplot

    with mpl.rc_context(STYLE | style):
        figure, axes = pyplot.subplots(figsize=(9.0, 4.8), dpi=110, layout="constrained")
        if plot.shade is not None:
            x, y, values = plot.shade
            axes.pcolormesh(
                x, y, values, cmap="Greys", vmin=0.0, vmax=2.0, shading="nearest", rasterized=True
            )
        for i, curve in enumerate(plot.curves):
            axes.plot(
                curve.x,
                curve.y,
                color=curve.colour or COLOURS[i % len(COLOURS)],
                linestyle=curve.line or "none",
                marker=curve.marker,
                markersize=4,
                linewidth=1.3,
                label=curve.label,
            )
        _finish(axes, plot)
        buffer = io.BytesIO()
        figure.savefig(buffer, format=kind, metadata=metadata, transparent=kind == "svg")
        pyplot.close(figure)
    return buffer.getvalue()


def _finish(axes: Any, plot: Plot) -> None:
    axes.set(title=plot.title, xlabel=plot.x_label, ylabel=plot.y_label)
    if "x" in plot.logarithmic:
        axes.set_xscale("log")
    if "y" in plot.logarithmic:
        axes.set_yscale("log")
    if plot.y_range is not None:
        axes.set_ylim(*plot.y_range)
    if any(curve.label for curve in plot.curves):
        axes.legend(fontsize="small", loc="upper left", bbox_to_anchor=(1.01, 1.0))
    axes.grid(True)
