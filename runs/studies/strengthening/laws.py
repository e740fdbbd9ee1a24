"""The part of the study on hyperelastic laws: tables and figure from the cases finished so far."""

import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from runs.display.numbers import number
from runs.display.style import look, panels, save_figure
from runs.studies.framework.case import Case
from runs.studies.framework.page import render
from runs.studies.strengthening.fitting import at_depth
from runs.studies.strengthening.pictures import COLORS, MARKS, Paths, Rows, bars, finish


def part(paths: Paths, folder: Path) -> str:
    """Write the figure; return the part of the answer as Markdown."""
    laws, foams = ([each for each in paths if each[0].labels["group"] == group] for group in ("laws", "foam"))
    drawn = [group for group in _by_layer(laws) if not _vanishes(group[1])]
    if drawn:
        _draw(drawn, folder)
    return render(
        __file__, "laws.md.jinja", laws=_laws(laws), spreads=list(_spreads(laws)), foams=list(_foams(foams)),
        drawn=bool(drawn),
    )  # fmt: skip


@look()
def _draw(groups: list[tuple[tuple[float, float], Paths]], folder: Path) -> None:
    """Write S_Q of every law, a panel for each layer, as laws.svg and .png."""
    figure, axes = panels(*[3.5] * len(groups), height=3.9)
    for axis, ((h, nu), here) in zip(axes, groups, strict=True):
        for i, (case, path) in enumerate(here):
            name = str(case.labels["law"]).replace("_", " ")
            bars(axis, path, "S_Q", COLORS[i % 5], MARKS[i % 6], name, shift=0.004 * i)
        finish(axis, [row for _, path in here for row in path], f"$S_Q$ by law, h = {h:g} R, ν = {nu:g}")
    save_figure(figure, folder, "laws")


def _by_layer(paths: Paths) -> list[tuple[tuple[float, float], Paths]]:
    groups: dict[tuple[float, float], list[tuple[Case, Rows]]] = {}
    for case, path in paths:
        groups.setdefault((case.labels["h"], case.labels["nu"]), []).append((case, path))
    return list(groups.items())


def _vanishes(paths: Paths) -> bool:
    """Return whether T at small strain changes sign along a load path, where ratios are not meaningful."""
    linear = [row["T_linear"] for _, path in paths for row in path]
    return min(linear) < 0.0 < max(linear)


def _depths(paths: Paths) -> list[float]:
    """Return the approaches over R with output, in rising order."""
    return sorted({round(step * case.problem.load.values[0], 9) for case, _ in paths for step in case.steps or ()})


def _laws(paths: Paths) -> list[dict[str, Any]]:
    """Return the factors of each hyperelastic law, at equal moduli at small strain."""
    return [
        {"h / R": case.labels["h"], "law": case.labels["law"], "nu": case.labels["nu"]}
        | {f"{s} at {depth:g} R": at_depth(path, depth, s) for depth in _depths(paths) for s in ("S_Q", "S_D")}
        for case, path in paths
    ]


def _spreads(paths: Paths) -> Iterator[dict[str, Any]]:
    """Yield by h and nu: least and greatest S_Q at the last load, number of laws, and whether T vanishes."""
    for (h, nu), here in _by_layer(paths):
        depth = _depths(here)[-1]
        factor = {case.labels["law"]: at_depth(path, depth, "S_Q") for case, path in here}
        known = sorted((value[0], law.replace("_", " ")) for law, value in factor.items() if value is not None)
        ends = [f"{number(value, 4)} ({law})" for value, law in (known[:1] + known[-1:])]
        yield {"h": h, "nu": nu, "depth": depth, "ends": ends, "count": len(known), "vanishes": _vanishes(here)}


def _foams(paths: Paths) -> Iterator[dict[str, Any]]:
    """Yield T of the paper's balls on foam at the last load, by law, over T on the neo-Hookean solid."""
    solids = {case.labels["nu"]: path for case, path in paths if case.labels["law"] == "neo_hookean"}
    for case, path in paths:
        row, beside = path[-1], None
        ratio, error = row["T"] / row["Q"], row["T_error"] / row["Q"]
        solid = next((s for s in solids.get(case.labels["nu"], ()) if math.isclose(s["D"], row["D"])), None)
        if solid is not None:
            value = ratio / (solid["T"] / solid["Q"])
            beside = value, abs(value) * math.hypot(error / ratio, solid["T_error"] / solid["T"])
        yield {
            "law": case.labels["law"], "nu": case.labels["nu"], "D / R": row["D"], "Q / E1 R²": row["Q"],
            "T / Q": (ratio, error), "T / Q over the solid's": beside,
            "S_Q": (row["S_Q"], row["S_Q_error"]), "S_D": (row["S_D"], row["S_D_error"]),
        }  # fmt: skip
