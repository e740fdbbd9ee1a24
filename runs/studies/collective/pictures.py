"""Figures of the study: map of outcomes, layers from above, growth of clusters and of hexatic order."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from linear_bem.arrays import Array
from runs.display.numbers import number
from runs.display.style import BLUE, GREEN, GREY, PURPLE, blank, look, panels, save_figure
from runs.evolution import record
from runs.evolution.hard_balls import HardBalls
from runs.evolution.layer_pictures import draw_layer
from runs.pictures.sheet import save_gif
from runs.scene.units import DIMENSIONLESS
from runs.session.output_folder import PATH
from runs.studies.collective.cases import DISTANCES, Case, Finished, PairLaw
from runs.studies.framework.study import CASES

COLORS = {"gathers": BLUE, "small groups": PURPLE, "orders": GREEN, "stays": GREY}


def _shades(thicknesses: Sequence[float]) -> dict[float, Any]:
    """Return a colour for every thickness, from dark (thin) to light."""
    from matplotlib import colormaps  # noqa: PLC0415  (slow to load)

    return dict(zip(thicknesses, colormaps["viridis"](np.linspace(0.0, 0.9, len(thicknesses))), strict=True))


@look()
def draw_map(folder: Path, found: Sequence[Finished], laws: Mapping[float, PairLaw]) -> None:
    """Write map.svg and .png: outcomes over thickness and area fraction, and the pair law of each thickness."""
    figure, (outcomes, pair) = panels(5.0, 5.0, height=3.9)
    seen, thicknesses = set(), sorted(laws)
    for done in found:
        case, row, outcome = done.case, done.row, done.outcome
        if case.seed != 1 or (case.thickness, case.fraction) in seen:
            continue
        seen.add((case.thickness, case.fraction))
        place = thicknesses.index(case.thickness), case.fraction
        outcomes.plot(*place, "o", ms=9, color=COLORS[outcome])
        grouped = outcome in ("gathers", "small groups")
        text = number(row["cluster_mean"], 3) if grouped else f"{row['hexatic_end']:.2f}"
        outcomes.annotate(text, place, xytext=(0, 9), textcoords="offset points", ha="center", fontsize=9)
    for name, color in COLORS.items():
        outcomes.plot([], [], "o", color=color, label=name)
    outcomes.set(
        xlabel="h / R", ylabel="area fraction", xlim=(-0.5, len(thicknesses) - 0.5), ylim=(0.0, 0.75),
        xticks=range(len(thicknesses)), xticklabels=[f"{h:g}" for h in thicknesses],
    )  # fmt: skip
    outcomes.legend(ncols=2, loc="upper center", bbox_to_anchor=(0.5, 1.0))
    outcomes.set_title("Balls in a cluster, or |psi_6|, at the end", pad=14)
    for h, color in _shades(thicknesses).items():
        pair.plot(DISTANCES, 1e3 * laws[h].ratio, color=color, label=f"h = {h:g} R")
    pair.axhline(0.0, color="0.55", lw=0.8, zorder=0)
    pair.set(xlabel="distance of two balls / R", ylabel="1000 T/Q", xlim=(2.0, 12.0))
    pair.set_title("Two balls: T > 0 attracts", pad=14)
    pair.legend()
    save_figure(figure, folder, "map")


@look()
def draw_ends(folder: Path, found: Sequence[Case]) -> None:
    """Write ends.png: the layer at the end of every run, a column per thickness."""
    columns = sorted({case.thickness for case in found})
    lines = sorted({case.fraction for case in found}, reverse=True)
    figure = blank(1.7 * len(columns), 1.9 * len(lines))
    axes = figure.subplots(len(lines), len(columns), squeeze=False)
    for axis in axes.ravel():
        axis.set_axis_off()
    for case in found:
        axis = axes[lines.index(case.fraction), columns.index(case.thickness)]
        axis.set_axis_on()
        run = folder / CASES / case.name / PATH
        _draw_cell(axis, case, record.read(run, len(list(run.glob("moment_*.npz"))) - 1).positions)
        axis.set_title(f"h = {case.thickness:g} R, {case.fraction:g}", fontsize=8.5)
    save_figure(figure, folder, "ends", ("png",))


def draw_gathering(folder: Path, case: Case, largest: float) -> None:
    """Write gathering.gif: the layer from above along the path of one run; ``largest`` T/Q of a pair."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg  # noqa: PLC0415  (slow to load)

    run = folder / CASES / case.name / PATH
    sheets = []
    with look():
        for number in range(len(list(run.glob("moment_*.npz")))):
            moment = record.read(run, number)
            figure = blank(3.6, 3.8)
            axis = figure.subplots()
            _draw_cell(axis, case, moment.positions)
            axis.set_title(f"h = {case.thickness:g} R, path {moment.sigma * largest:.1f}")
            canvas = FigureCanvasAgg(figure)
            canvas.draw()
            sheets.append(np.asarray(canvas.buffer_rgba())[:, :, :3].copy())
    if sheets:
        save_gif(sheets, folder / "gathering.gif")


def _draw_cell(axis: Any, case: Case, positions: Array) -> None:
    """Draw the balls in the frame of their periodic cell."""
    balls = HardBalls(np.ones(case.count), np.array([case.length] * 2))
    draw_layer(axis, positions, balls, DIMENSIONLESS.length)
    axis.set(xticks=[], yticks=[], xlabel="", ylabel="")
    for spine in axis.spines.values():
        spine.set(visible=True, linewidth=0.6, color="0.4")


@look()
def draw_growth(folder: Path, found: Sequence[Finished]) -> None:
    """Write growth.svg and .png: mean cluster and hexatic order over the path at one area fraction."""
    chosen = {done.case.thickness: done.rows[1:] for done in found if done.case.fraction == 0.3 and done.case.seed == 1}
    figure, (clusters, order) = panels(5.0, 5.0, height=3.8)
    for h, color in _shades(sorted(chosen)).items():
        path = [row["cycle"] for row in chosen[h]]
        for axis, key in ((clusters, "cluster_mean"), (order, "hexatic_local")):
            axis.plot(path, [row[key] for row in chosen[h]], color=color, label=f"h = {h:g} R")
    clusters.set(xscale="log", yscale="log", xlabel="path", ylabel="balls in the cluster of a ball, mean")
    order.set(xscale="log", xlabel="path", ylabel="mean of |psi_6|", ylim=(0.2, 1.0))
    clusters.legend(fontsize=8)
    save_figure(figure, folder, "growth")
