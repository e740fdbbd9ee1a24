"""The common style of figures: fonts, colours for colour-blind readers, marked features."""

import contextlib
import re
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from runs.process.files import replacing

BLUE, ORANGE, GREEN, PURPLE, GREY = "#0072b2", "#d55e00", "#009e73", "#aa4499", "#666666"
"""Okabe and Ito's colours, distinguishable with every kind of colour vision."""
LAYER = ["#efeae0", "#f6d6a0", "#f3a95f", "#e06a3c", "#b02f4b", "#6a1a56", "#2a1041"]
"""From the colour of unstressed foam to dark, with monotonically decreasing lightness."""
SETTINGS = {
    "font.size": 10,
    "figure.dpi": 100,
    "axes.titlesize": 10.5,
    "axes.titlelocation": "left",
    "axes.spines.top": False,
    "axes.spines.right": False,
    "legend.frameon": False,
    "legend.fontsize": 9,
    "lines.linewidth": 1.7,
    "svg.fonttype": "none",
    "svg.hashsalt": "thirdbody",
}


@contextlib.contextmanager
def look() -> Iterator[None]:
    """Context in which figures are drawn and saved with common fonts, spines and legends."""
    import matplotlib as mpl  # noqa: PLC0415  (slow to load)

    with mpl.rc_context(SETTINGS):
        yield


def blank(width: float, height: float) -> Any:
    """Return an empty figure, sides in inches, that needs no display."""
    from matplotlib.figure import Figure  # noqa: PLC0415  (slow to load)

    return Figure(figsize=(width, height), layout="constrained")


def panels(*widths: float, height: float = 4.2) -> tuple[Any, Any]:
    """Return a figure and its panels side by side, ``widths`` and ``height`` in inches."""
    figure = blank(sum(widths), height)
    axes = figure.subplots(1, len(widths), width_ratios=widths, squeeze=False)[0]
    figure.get_layout_engine().set(w_pad=0.1, wspace=0.03)
    return figure, axes


def grid(count: int, width: float, height: float) -> tuple[Any, list[Any]]:
    """Return a figure of ``count`` panels in up to three columns, each ``width`` by ``height`` inches."""
    columns = min(3, count)
    lines = -(-count // columns)
    figure = blank(columns * width, lines * height)
    axes = figure.subplots(lines, columns, squeeze=False).ravel()
    for spare in axes[count:]:
        spare.set_axis_off()
    return figure, list(axes[:count])


def save_figure(figure: Any, folder: Path, stem: str, kinds: Sequence[str] = ("svg", "png")) -> None:
    """Write STEM.svg and STEM.png, or only some kinds; the SVG contains no date."""
    for kind in kinds:
        with replacing(folder / f"{stem}.{kind}") as draft:
            figure.savefig(draft, format=kind, **({"dpi": 160} if kind == "png" else {"metadata": {"Date": None}}))
        figure.set_layout_engine(None)  # placed once: an engine of any kind takes as long as drawing


def dark_on_white() -> Any:
    """Return the colour map of a pressure: white is zero, and the colours are those of the pictures."""
    from matplotlib.colors import LinearSegmentedColormap  # noqa: PLC0415

    return LinearSegmentedColormap.from_list("dark on white", ["#ffffff", *LAYER[1:]])


def map_colors() -> dict[str, Any]:
    """Return colour map and scale of T/T0: orange separates, white is zero, blue attracts."""
    from matplotlib.colors import LinearSegmentedColormap, SymLogNorm  # noqa: PLC0415

    colors = LinearSegmentedColormap.from_list("sign", ["#b35806", "#fdb863", "#ffffff", "#92c5de", "#2166ac"])
    return {"cmap": colors, "norm": SymLogNorm(1e-3, linscale=0.3, vmin=-1.0, vmax=1.0)}


def checked_signs(axes: Any, points: Sequence[tuple[float, float, float]]) -> None:
    """Mark the sign of the full solver's T at points (x, y, T): triangles up attract, triangles down separate."""
    for sign, marker, what in ((1.0, "^", "attraction"), (-1.0, "v", "separation")):
        x, y = [p[0] for p in points if p[2] * sign > 0.0], [p[1] for p in points if p[2] * sign > 0.0]
        style = {"color": "black", "mfc": "none", "ms": 7, "clip_on": False, "zorder": 4}
        if x:
            axes.plot(x, y, marker, label=f"full solver: {what}", **style)


def minus(text: str) -> str:
    """Return a text whose numbers have minus signs in place of hyphens."""
    return re.sub(r"(?<![\w)])-(?=[\d.])|(?<=\de)-(?=\d)", "\N{MINUS SIGN}", text)


def zero_line(axes: Any) -> None:
    """Draw T = 0."""
    axes.axhline(0.0, color="0.55", lw=0.8, zorder=0)


def dot_lines(axes: Any) -> None:
    """Draw lines of one point, which have no length, as dots."""
    for line in axes.lines:
        if len(line.get_xdata()) == 1:
            line.set_marker("o")


def error_bars(
    axes: Any, points: Sequence[tuple[float, float, float]], numerators: Sequence[float] | None = None, **style: Any
) -> None:
    """Draw points (x, value, error) joined by a line, interrupted where the value changes sign.

    With the ``numerators`` of ratios, also where the denominators change sign: the ratio has a pole there.
    """
    if points:
        columns = np.transpose(points)
        turns = columns[1, :-1] * columns[1, 1:] < 0.0
        if numerators is not None:
            denominators = np.sign(numerators) * np.sign(columns[1])
            turns |= denominators[:-1] * denominators[1:] < 0.0
        breaks = np.flatnonzero(turns) + 1
        axes.errorbar(*np.insert(columns, breaks, np.nan, axis=1), **{"ms": 4, "capsize": 2} | style)


def legend_or_note(axes: Any, **style: Any) -> None:
    """Add a legend, or a note in a panel without data."""
    if axes.get_legend_handles_labels()[0]:
        axes.legend(**style)
    elif not axes.has_data():
        axes.text(0.5, 0.5, "not there yet", ha="center", transform=axes.transAxes, color=GREY)


def feature(
    axes: Any,
    x: float,
    y: float,
    text: str,
    offset: tuple[float, float],
    color: str = "0.15",
    marker: str = "o",
    line: str | None = None,
) -> None:
    """Mark a point and name it; ``offset`` [points] places the text."""
    axes.plot([x], [y], marker, color=color, ms=5.5, mfc="white", mew=1.5, zorder=5)
    axes.annotate(
        minus(text),
        (x, y),
        xytext=offset,
        textcoords="offset points",
        fontsize=9,
        color=color,
        ha="left" if offset[0] >= 0.0 else "right",
        va="center",
        arrowprops={"arrowstyle": "-", "color": line or color, "lw": 0.7, "shrinkB": 4},
        zorder=6,
    )
