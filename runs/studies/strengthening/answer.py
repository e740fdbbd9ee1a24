"""The study's answer in words and tables, drawn from whatever cases are there."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from runs.display.numbers import number, with_error
from runs.process.files import write_csv
from runs.studies.framework.case import Case
from runs.studies.framework.runner import study_of_cases
from runs.studies.framework.saved_cases import Found
from runs.studies.framework.tables import markdown
from runs.studies.strengthening import fitting, pictures
from runs.studies.strengthening.fitting import at_depth
from runs.studies.strengthening.matrix import LAW_APPROACHES, SIDES, cases
from runs.studies.strengthening.ratios import factors

Rows = Sequence[Mapping[str, Any]]
STRONGER, OPPOSITE = "stronger", "of the other sign than at small strain"
COMMON = 0.1
"""Largest misfit of one curve through several that is worth a formula."""
DEPTHS = (0.05, 0.15, 0.32, 0.5, 0.6)
"""Approaches over R that curves are read at."""


def present(found: Found, folder: Path) -> str:
    """Write tables and figures; return the answer as Markdown."""
    rows = factors(found, folder)
    named = {case.name: case for case in found.cases}
    flat = [{"case": name, **named[name].labels, **row} for name, path in rows.items() for row in path]
    if flat:
        write_csv(folder / "factors.csv", flat)
    fits = {side: _headline_fit(rows, h, side) for h, side in SIDES.items()}
    pictures.draw(found, rows, fits, folder)
    lines = ["# How much stronger finite strain makes the tangential force", ""]
    lines += _sentence(found, rows)
    lines += ["", "![Strengthening of both cases along the load](strengthening.svg)"]
    for h, side in SIDES.items():
        lines += _path(headline(rows, side), h, side)
    lines += _ladder(rows)
    lines += _slopes(found, rows)
    lines += _parameters(found, rows)
    lines += ["", "![Poisson's ratio, distance, and sign of T](parameters.svg)"]
    lines += _laws(found, rows)
    lines += _fits(found, rows, fits)
    return "\n".join(lines)


def _sentence(found: Found, rows: Mapping[str, Rows]) -> list[str]:
    """Say where the effect is stronger at finite strain, where weaker, and where the error bar cannot tell."""
    verdicts: dict[str, list[str]] = {STRONGER: [], "weaker": [], "within its error bar of 1": [], OPPOSITE: []}
    for case in found.cases:
        path = [row for row in rows.get(case.name, []) if row["S_Q"] is not None]
        if not path or case.labels["group"] not in ("headline", "distance", "poisson"):
            continue
        row = path[-1]
        lowest, highest = row["S_Q"] - row["S_Q_error"], row["S_Q"] + row["S_Q_error"]
        kind = STRONGER if lowest > 1.0 else "within its error bar of 1" if highest >= 1.0 else "weaker"
        if highest < 0.0:  # where T changes its sign with the load, at another load than at small strain
            kind = OPPOSITE
        verdicts[kind].append(f"{_words(case)}: {with_error(row['S_Q'], row['S_Q_error'])} at D = {number(row['D'])} R")
    if not any(verdicts.values()):
        return ["No load path is there yet."]
    lines = [
        '"For the case of finite deformations, the effect should be stronger" [1]: at equal force and full load T is'
    ]
    for kind, words in verdicts.items():
        lines.append(f"- **{kind}** in {len(words)} case(s)" + (f": {'; '.join(words)}." if words else "."))
    stronger_from = []
    for h, side in SIDES.items():
        path = [row for row in headline(rows, side) if row["S_Q"] is not None]
        from_here = [row["D"] for i, row in enumerate(path) if all(r["S_Q"] - r["S_Q_error"] > 1.0 for r in path[i:])]
        if from_here:
            stronger_from.append(f"for h = {h:g} R from D = {number(from_here[0], 3)} R on")
        elif path:
            stronger_from.append(f"for h = {h:g} R at no load up to D = {number(path[-1]['D'], 3)} R")
    if stronger_from:
        lines += ["", f"Resolved as stronger {'; '.join(stronger_from)} (L = 2 R, nu = 0.48)."]
    return [*lines, "", "[1] Materials 2021, 14(19), 5689, doi 10.3390/ma14195689."]


def headline(rows: Mapping[str, Rows], side: str, group: str = "headline") -> Rows:
    """Return the rows of the paper's pair on the thin or the thick layer."""
    return rows.get(f"{group}-{side}-L2-nu0.48", [])


def _words(case: Case) -> str:
    return "h = {h:g} R, L = {L:g} R, nu = {nu:g}".format(**case.labels)


def _path(path: Rows, h: float, side: str) -> list[str]:
    shown = [
        {
            "D / R": row["D"],
            "Q / E1 R²": row["Q"],
            "T / Q": row["T"] / row["Q"],
            "sphere / paraboloid": row["geometry"],
            "S_Q": (row["S_Q"], row["S_Q_error"]),
            "S_D": (row["S_D"], row["S_D_error"]),
        }
        for row in path
    ]
    return ["", f"## Along the load, {side} layer: h = {h:g} R, L = 2 R, nu = 0.48", "", *markdown(shown)]


def _ladder(rows: Mapping[str, Rows]) -> list[str]:
    """Say what the indenter's exact shape adds and what the bulk adds, at equal force."""
    shown = []
    for side in SIDES.values():
        path = headline(rows, side)
        plain = headline(rows, side, "paraboloid")
        for depth in DEPTHS:
            bulk = at_depth(path, depth)
            shape = at_depth(path, depth, "geometry")
            load = at_depth(path, depth, "Q")
            if bulk is None or shape is None or load is None:
                continue
            total = (bulk[0] * shape[0], bulk[1] * shape[0])
            shown.append(
                {
                    "layer": side,
                    "D / R": depth,
                    "paraboloid, small strain": 1.0,
                    "sphere, small strain": shape[0],
                    "paraboloid, finite strain": at_depth(plain, load[0], measure="Q"),
                    "sphere, finite strain": total,
                    "of it the bulk (S_Q)": bulk,
                }
            )
    text = (
        "T over that of the paraboloid at small strain (the paper's model), one thing added at a time, at equal force:"
    )
    return ["", "## Shape of the ball against strain of the bulk", "", text, "", *markdown(shown)]


def _slopes(found: Found, rows: Mapping[str, Rows]) -> list[str]:
    """Fit the slope with which every curve leaves 1."""
    shown = []
    for case in found.cases:
        # the deeper curves are the headline's, and paraboloids and the change of sign have tables of their own
        if case.labels["group"] in ("sign", "deeper", "paraboloid", "laws") or case.name not in rows:
            continue
        slopes = {x: fitting.initial_slope(rows[case.name], x, case.labels["h"]) for x in ("sqrt(D/R)", "D/R")}
        if all(slopes.values()):
            both = {x: (s.coefficients[0], s.errors[0]) for x, s in slopes.items() if s is not None}
            c, e = both["D/R"]
            resolved = f"yes, {'below' if c < 0 else 'above'} 1" if abs(c) > e else "no"
            shown.append({"case": _words(case), **both, "leaves 1": resolved})
    text = (
        f"S_Q - 1 = c x + c' x² fitted to D <= {fitting.SMALL_LOAD:g} R, with x = sqrt(D/R) and with x = D/R: c and "
        "its error. Forces and contact radii depart from linear theory like sqrt(D/R); where that root's c is small "
        "beside c of D/R, their ratio S_Q leaves 1 in proportion to D; c of D/R says whether it does."
    )
    return ["", "## Initial slope of S_Q", "", text, "", *markdown(shown)]


def _parameters(found: Found, rows: Mapping[str, Rows]) -> list[str]:
    shown, signs = [], []
    for case in found.cases:
        path = rows.get(case.name)
        if not path:
            continue
        if case.labels["group"] == "sign":
            changes = {key: fitting.sign_change(path, key) for key in ("T", "T_linear", "T_paraboloid")}
            deepest = max(row["D"] for row in path)
            signs.append(
                {
                    "h / R": case.labels["h"],
                    "T at the first load": path[0]["T"],
                    f"T at D = {deepest:g} R": path[-1]["T"],
                    "finite strain: T = 0 at D / R": changes["T"],
                    "small strain, sphere": changes["T_linear"],
                    "small strain, paraboloid": changes["T_paraboloid"],
                }
            )
        elif case.labels["group"] in ("headline", "deeper", "distance", "poisson"):
            read = {f"S_Q at {depth:g} R": at_depth(path, depth) for depth in DEPTHS}
            shown.append({"h / R": case.labels["h"], "L / R": case.labels["L"], "nu": case.labels["nu"], **read})
    shown.sort(key=lambda row: (row["h / R"], row["L / R"], row["nu"]))
    lines = ["", "## Distance, thickness, Poisson's ratio", "", *markdown(shown)]
    if signs:
        lines += ["", "## Where the sign of T changes with the load (dash: it does not)", "", *markdown(signs)]
    return lines


def _laws(found: Found, rows: Mapping[str, Rows]) -> list[str]:
    """Say how far the factors depend on the hyperelastic law, at equal moduli at small strain."""
    shown, paths = [], dict[float, list[Rows]]()
    for case in found.cases:
        if case.labels["group"] != "laws" or not rows.get(case.name):
            continue
        row: dict[str, Any] = {"law": case.labels["law"], "nu": case.labels["nu"]}
        for depth in LAW_APPROACHES:
            for measure in ("S_Q", "S_D"):
                row[f"{measure} at {depth:g} R"] = at_depth(rows[case.name], depth, measure)
        shown.append(row)
        paths.setdefault(case.labels["nu"], []).append(rows[case.name])
    if not shown:
        return []
    lines = ["", "## Does the law matter?", "", *markdown(shown), ""]
    for nu, group in paths.items():
        linear = [row["T_linear"] for path in group for row in path]
        deepest = [known[0] for path in group if (known := at_depth(path, LAW_APPROACHES[-1], "S_Q")) is not None]
        if min(linear) < 0.0 < max(linear):
            lines.append(f"At nu = {nu:g} T at small strain passes through zero on the way: ratios say little there.")
        elif len(deepest) > 1:
            lines.append(
                f"At D = {LAW_APPROACHES[-1]:g} R and nu = {nu:g} S_Q lies between {number(min(deepest), 4)} and "
                f"{number(max(deepest), 4)}, over {len(deepest)} laws of equal moduli at small strain."
            )
    return [*lines, "", "![S_Q of every law along the load](laws.svg)"]


def _fits(found: Found, rows: Mapping[str, Rows], fits: Mapping[str, fitting.Fit | None]) -> list[str]:
    lines = ["", "## Fits to compute by hand", ""]
    lines += [
        f"- h = {h:g} R, L = 2 R, nu = 0.48: S_Q = {one.formula()}"
        for h, side in SIDES.items()
        if (one := fits[side]) is not None
    ]
    for group, words in (("distance", "all distances"), ("poisson", "all Poisson's ratios")):
        for h in SIDES:
            curves = {
                case.name: (rows[case.name], h)
                for case in found.cases
                if case.labels["group"] in (group, "headline") and case.labels["h"] == h and rows.get(case.name)
            }
            best = fitting.collapse(curves)
            if len(curves) > 1 and best:
                begin = f"- h = {h:g} R, {words} ({len(curves)} curves): "
                if best[0].misfit > COMMON:
                    lines.append(
                        f"{begin}no common curve; the best measure, {best[0].variable}, misses by {best[0].misfit:.2g}"
                    )
                    continue
                second = f"next best measure {best[1].variable}, within {best[1].misfit:.2g}"
                lines.append(f"{begin}S_Q = {best[0].formula()}; {second}")
    return lines if len(lines) > 3 else [*lines, "(no load path is long enough yet)"]


def _headline_fit(rows: Mapping[str, Rows], h: float, side: str) -> fitting.Fit | None:
    path = headline(rows, side)
    return fitting.best({x: fitting.points(path, x, h) for x in ("sqrt(D/R)", "D/R")})


PICTURES = [f"{name}.{kind}" for name in ("strengthening", "parameters", "laws") for kind in ("svg", "png")]
STUDY = study_of_cases("strengthening", cases, present, PICTURES)
