"""The study's figure: one ball, T at vanishing load, mesh convergence, and the routes to T."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from runs.display.style import BLUE, GREEN, ORANGE, PURPLE, blank, error_bars, legend_or_note, look, save_figure
from runs.studies.verification.part import Row

COLORS = (BLUE, ORANGE, GREEN, PURPLE)
Tables = Mapping[str, Sequence[Row]]


@look()
def draw(tables: Tables, folder: Path) -> None:
    """Write verification.svg and .png; a panel without rows says so."""
    figure = blank(9.0, 7.6)
    axes = figure.subplots(2, 2).ravel()
    _one_ball(axes[0], tables["one-ball"])
    _small_load(axes[1], tables["small-load"])
    _convergence(axes[2], tables["convergence"])
    _routes(axes[3], tables["routes"])
    for axis in axes:
        legend_or_note(axis, fontsize=8)
    save_figure(figure, folder, "verification")


def _one_ball(axis: Any, rows: Sequence[Row]) -> None:
    finite = [row for row in rows if row["model"] == "finite_strain"]
    for color, h in zip(COLORS, sorted({row["h"] for row in finite}), strict=False):
        mine = [row for row in finite if row["h"] == h]
        points = {row["D"]: row["ratio"] for row in mine}
        error_bars(axis, [(d, *ratio) for d, ratio in points.items()], fmt="o", color=color, label=f"h = {h:g} R")
        known = [(row["D"], row["expected"]) for row in mine]
        axis.plot(
            *zip(*known, strict=True), ls="", marker="x", color=color, label=f"{mine[0]['reference']}, h = {h:g} R"
        )
    axis.set(xlabel="D / R", ylabel="Q / Q Hertz", title="one sphere, finite strain, nu = 0.5")


def _small_load(axis: Any, rows: Sequence[Row]) -> None:
    places = list(dict.fromkeys((row["h"], row["L"]) for row in rows))
    for shift, color, model in ((-0.12, BLUE, "small_strain"), (0.12, ORANGE, "finite_strain")):
        mine = [row for row in rows if row["model"] == model]
        points = [(places.index((row["h"], row["L"])) + shift, *row["ratio"]) for row in mine]
        error_bars(axis, points, fmt="o", color=color, label=model)
    if rows:
        axis.axhspan(0.99, 1.01, color="0.9", zorder=0)
        axis.set_xticks(range(len(places)), [f"{h:g}\n{distance:g}" for h, distance in places])
        low = min(0.98, *(value - error for value, error in (row["ratio"] for row in rows)))
        high = max(1.02, *(value + error for value, error in (row["ratio"] for row in rows)))
        axis.set_ylim(max(low - 0.005, 0.8), min(high + 0.012, 1.2))
    axis.set(xlabel="h / R (above), L / R (below)", ylabel="T / T linear", title="load to 0 (band: 1 %)")


def _convergence(axis: Any, rows: Sequence[Row]) -> None:
    for number, row in enumerate(rows):
        resolutions, errors = ([float(part) for part in row[key].split(", ")] for key in ("resolution", "errors"))
        style, label = "o-" if row["quantity"] == "Q" else "s--", f"{row['quantity']}, nu = {row['nu']:g}"
        sizes = [abs(error) for error in errors]
        axis.plot(resolutions, sizes, style, ms=4, lw=1.2, color=COLORS[number // 2 % 4], label=label)
    if axis.has_data():
        axis.set(xscale="log", yscale="log")
        axis.set_xticks(resolutions, [f"{f:g}" for f in resolutions])
        axis.minorticks_off()
    axis.set(xlabel="order times fineness", ylabel="error against linear_bem [%]", title="convergence, small strain")


def _routes(axis: Any, rows: Sequence[Row]) -> None:
    if rows:
        x = [row["D"] for row in rows]
        bar = [100.0 * row["bar"] for row in rows]
        axis.fill_between(x, [-b for b in bar], bar, color="0.88", label="error bar", zorder=0)
        axis.plot(x, [100.0 * row["traction off"] for row in rows], "s-", color=BLUE, ms=4, lw=1.2, label="traction")
        axis.plot(x, [100.0 * row["energy off"] for row in rows], "^-", color=ORANGE, ms=4, lw=1.2, label="energy")
        axis.axhline(0.0, color="0.5", lw=0.8, zorder=0)
    axis.set(xlabel="D / R", ylabel="off the domain integral [%]", title="routes to T, thin pair")
