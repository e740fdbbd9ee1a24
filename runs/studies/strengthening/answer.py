"""The study's tables, from the cases finished so far; the text is in the template next to this file."""

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from runs.display.numbers import number, with_error
from runs.studies.framework.case import Case
from runs.studies.framework.page import render
from runs.studies.framework.runner import study_of_cases
from runs.studies.framework.saved_cases import Found
from runs.studies.strengthening import fitting, laws, pictures
from runs.studies.strengthening.fitting import at_depth
from runs.studies.strengthening.matrix import SIDES, cases, law_cases
from runs.studies.strengthening.pictures import Paths, Rows
from runs.studies.strengthening.ratios import load_paths

STRONGER, OPPOSITE = "stronger", "of the other sign than at small strain"
COMMON = 0.1
"""Largest misfit at which one curve through several is given as a formula."""
LAWS = ("laws", "foam")
"""Groups of the part on laws."""
DEPTHS = (0.05, 0.15, 0.32, 0.5, 0.6)
"""Approaches over R at which curves are tabulated."""


def present(found: Found, folder: Path) -> str:
    """Write tables and figures; return the answer as Markdown."""
    every = load_paths(found, folder)
    paths, others = ([one for one in every if (one[0].labels["group"] in LAWS) is each] for each in (False, True))
    rows = {case.name: path for case, path in paths}
    main = {side: headline(rows, side) for side in SIDES.values()}
    fits = {
        side: fitting.best({x: fitting.points(main[side], x, h) for x in ("sqrt(D/R)", "D/R")})
        for h, side in SIDES.items()
    }
    pictures.draw(paths, main, fits, folder)
    return render(
        __file__,
        verdicts=_verdicts(paths),
        stronger_from=[(h, *ends) for h, side in SIDES.items() if (ends := _stronger_from(main[side]))],
        paths=[(h, side, [_along(row) for row in main[side]]) for h, side in SIDES.items()],
        ladder=list(_ladder(rows)), small_load=fitting.SMALL_LOAD, slopes=list(_slopes(paths)),
        parameters=_parameters(paths), signs=_signs(paths),
        fits=[(h, fits[side]) for h, side in SIDES.items() if fits[side]], common=list(_common(paths)), most=COMMON,
        laws=laws.part(others, folder),
    )  # fmt: skip


def _verdicts(paths: Paths) -> dict[str, list[str]]:
    """Return the cases where T is stronger at finite strain, weaker, or equal within its error bar."""
    verdicts: dict[str, list[str]] = {STRONGER: [], "weaker": [], "within its error bar of 1": [], OPPOSITE: []}
    for case, path in paths:
        known = [row for row in path if row["S_Q"] is not None]
        if not known or case.labels["group"] not in ("headline", "distance", "poisson"):
            continue
        row = known[-1]
        lowest, highest = row["S_Q"] - row["S_Q_error"], row["S_Q"] + row["S_Q_error"]
        kind = STRONGER if lowest > 1.0 else "within its error bar of 1" if highest >= 1.0 else "weaker"
        if highest < 0.0:  # T changes sign with the load, but at another load than at small strain
            kind = OPPOSITE
        verdicts[kind].append(f"{_words(case)}: {with_error(row['S_Q'], row['S_Q_error'])} at D = {number(row['D'])} R")
    return verdicts


def _stronger_from(path: Rows) -> tuple[float | None, float] | None:
    """Return the approach over R from which T is stronger beyond its error bar (None: nowhere), and the largest one."""
    known = [row for row in path if row["S_Q"] is not None]
    beyond = [row["D"] for i, row in enumerate(known) if all(r["S_Q"] - r["S_Q_error"] > 1.0 for r in known[i:])]
    return (min(beyond, default=None), known[-1]["D"]) if known else None


def headline(rows: Mapping[str, Rows], side: str, group: str = "headline") -> Rows:
    """Return the rows of the paper's pair on the thin or the thick layer."""
    return rows.get(f"{group}-{side}-L2-nu0.48", [])


def _along(row: Mapping[str, Any]) -> dict[str, Any]:
    return {**row, "T/Q": row["T"] / row["Q"], **{s: (row[s], row[f"{s}_error"]) for s in ("S_Q", "S_D")}}


def _words(case: Case) -> str:
    return "h = {h:g} R, L = {L:g} R, nu = {nu:g}".format(**case.labels)


def _ladder(rows: Mapping[str, Rows]) -> Iterator[dict[str, Any]]:
    """Yield the contributions of the indenter's exact shape and of finite strain in the bulk, at equal force."""
    for side in SIDES.values():
        path, plain = headline(rows, side), headline(rows, side, "paraboloid")
        for depth in DEPTHS:
            bulk, shape, load = (at_depth(path, depth, factor) for factor in ("S_Q", "geometry", "Q"))
            if bulk is not None and shape is not None and load is not None:
                yield {
                    "layer": side, "depth": depth, "one": 1.0, "shape": shape[0],
                    "plain": at_depth(plain, load[0], measure="Q"),
                    "total": (bulk[0] * shape[0], bulk[1] * shape[0]), "bulk": bulk,
                }  # fmt: skip


def _slopes(paths: Paths) -> Iterator[dict[str, Any]]:
    """Yield the fitted slope of every curve at zero load, where it is 1."""
    for case, path in paths:
        # the deeper curves are those of the headline; paraboloids and the sign change have separate tables
        if case.labels["group"] in ("sign", "deeper", "paraboloid"):
            continue
        slopes = {x: fitting.initial_slope(path, x, case.labels["h"]) for x in ("sqrt(D/R)", "D/R")}
        if all(slopes.values()):
            both = {x: (s.coefficients[0], s.errors[0]) for x, s in slopes.items() if s is not None}
            c, e = both["D/R"]
            resolved = f"yes, {'below' if c < 0 else 'above'} 1" if abs(c) > e else "no"
            yield {"case": _words(case), **both, "leaves 1": resolved}


def _parameters(paths: Paths) -> list[dict[str, Any]]:
    shown = [
        {"h / R": case.labels["h"], "L / R": case.labels["L"], "nu": case.labels["nu"]}
        | {f"S_Q at {depth:g} R": at_depth(path, depth) for depth in DEPTHS}
        for case, path in paths
        if case.labels["group"] in ("headline", "deeper", "distance", "poisson")
    ]
    return sorted(shown, key=lambda row: (row["h / R"], row["L / R"], row["nu"]))


def _signs(paths: Paths) -> list[dict[str, Any]]:
    changes = {
        "finite strain: T = 0 at D / R": "T", "small strain, sphere": "T_linear",
        "small strain, paraboloid": "T_paraboloid",
    }  # fmt: skip
    return [
        {
            "h / R": case.labels["h"],
            "T at the first load": path[0]["T"],
            f"T at D = {max(row['D'] for row in path):g} R": path[-1]["T"],
            **{heading: fitting.sign_change(path, key) for heading, key in changes.items()},
        }
        for case, path in paths
        if case.labels["group"] == "sign"
    ]


def _common(paths: Paths) -> Iterator[tuple[Any, ...]]:
    """Yield one fit through several curves: thickness, curves in words and their number, best and second measure."""
    for group, words in (("distance", "all distances"), ("poisson", "all Poisson's ratios")):
        for h in SIDES:
            curves = {
                case.name: (path, h)
                for case, path in paths
                if case.labels["group"] in (group, "headline") and case.labels["h"] == h
            }
            best = fitting.collapse(curves)
            if len(curves) > 1 and best:
                yield h, words, len(curves), best[0], best[1]


PICTURES = [f"{name}.{kind}" for name in ("strengthening", "parameters", "laws") for kind in ("svg", "png")]
STUDY = study_of_cases("strengthening", lambda quick: [*cases(quick), *law_cases(quick)], present, PICTURES)
