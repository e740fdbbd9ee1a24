"""The study's page: outcomes of the random starts as table, phase map and pictures; growth laws; answer in words."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from runs.process.files import write_csv
from runs.studies import Options
from runs.studies.collective import boundary, cases, pictures
from runs.studies.collective.cases import Finished, PairLaw
from runs.studies.framework.page import render
from runs.studies.framework.runner import run_cases
from runs.studies.framework.saved_cases import Found, StudyFolder
from runs.studies.framework.study import CASES, Study, command, timed

SHOWN = (6.0, 0.3, 1)
"""Thickness over R, area fraction and seed of the run in the animation."""
NETWORK = 0.5
"""Mean cluster size over the number of balls from which clusters count as joined to one network."""
GROWING = (2.0, 0.5)
"""Range of the growth law: mean cluster size from this number of balls to this share of the largest one at the end."""

WAVES = {
    "gathers": "on layers that gather", "small groups": "where small groups form", "orders": "on layers that order",
    "stays": "on layers that stay as they are",
}  # fmt: skip
"""Words for the growth rates of waves, by the outcome of the run."""


@dataclass(frozen=True)
class Growth:
    """Cluster size ~ path^exponent: the fit of one run, its standard error, and the range of sizes fitted."""

    exponent: float
    error: float
    sizes: tuple[float, float]


def compute(folder: Path, options: Options) -> None:
    """Complete every unfinished case."""
    place = folder / CASES
    place.mkdir(exist_ok=True)
    for case in cases.cases(options.quick):
        with timed(case.name):
            cases.evolve(case, place, fresh=options.fresh)
    run_cases("collective", [] if options.quick else boundary.cases(), folder, options)


def page(folder: Path, quick: bool) -> str:
    """Write tables and figures; return the answer as Markdown."""
    there = [done for case in cases.cases(quick) if (done := cases.read(case, folder / CASES)) is not None]
    write_csv(folder / "collective.csv", [{**done.row, "outcome": done.outcome} for done in there])
    deep = [done for done in there if done.case.approach == cases.DEEP]
    found = [done for done in there if done not in deep]
    laws = {h: cases.pair_law(h, cases.APPROACH, finite=False) for h in sorted({done.case.thickness for done in found})}
    if found:
        free = [done for done in found if done.case.rolling == 0.0]
        pictures.draw_map(folder, free, laws)
        pictures.draw_ends(folder, [done.case for done in free if done.case.seed == 1])
        pictures.draw_growth(folder, free)
        for case in (d.case for d in free if (d.case.thickness, d.case.fraction, d.case.seed) == SHOWN):
            pictures.draw_gathering(folder, case, laws[case.thickness].largest)
    touching = Found.of(StudyFolder(folder, "collective"), [] if quick else boundary.cases())
    missing = (f"- {sentence}" for sentence in touching.missing())
    return "\n".join([text(found, laws, boundary.read(touching), quick, deep), *missing])


def growth(done: Finished) -> Growth | None:
    """Return the growth law of a run, fitted by least squares in logarithms.

    None if clusters do not grow enough, or if they join to one network through the cell.
    """
    size = np.array([row["cluster_mean"] for row in done.rows])
    if done.rows and size[-1] > NETWORK * done.case.count:
        return None
    path = np.array([row["cycle"] for row in done.rows])
    used = (size >= GROWING[0]) & (size <= GROWING[1] * size[-1]) & (path > 0.0)
    if np.sum(used) < 5 or size[used][-1] < 2.0 * size[used][0]:
        return None
    x, y = np.log(path[used]), np.log(size[used])
    fit, spread = np.polyfit(x, y, 1, cov=True)
    return Growth(float(fit[0]), float(np.sqrt(spread[0, 0])), (float(size[used][0]), float(size[used][-1])))


def text(
    found: Sequence[Finished],
    laws: Mapping[float, PairLaw],
    touching: Sequence[dict[str, Any]],
    quick: bool,
    deep: Sequence[Finished] = (),
) -> str:
    """Return the answer as Markdown; ``touching`` are the rows of `boundary`, ``deep`` the runs by both models."""
    free = [done for done in found if done.case.rolling == 0.0]
    ended = [done for done in (*found, *deep) if done.row["ended"] != "interrupted"]
    gathered = [done for done in free if done in ended and done.outcome == "gathers"]
    wanted, waves = cases.cases(quick), list(_waves(free, laws))
    return render(
        __file__, free=len(free), still=sum(done.outcome == "stays" for done in free),
        attract=min((h for h, law in laws.items() if law.ratio[0] > 0.0), default=None),
        soft=min((h for h, law in laws.items() if law.softens), default=None),
        part=max((h for h, law in laws.items() if not law.softens), default=None),
        weaker={h: law for h, law in laws.items() if law.softens and law.ratio[0] <= 0.0},
        driven=_ends(done.row["force_over_load"] for done in free),
        contacts=_ends(done.row["coordination"] for done in free if done.outcome == "small groups"),
        ends=_ends(done.row["cluster_mean"] for done in gathered),
        scenes={outcome: _scenes(free, outcome) for outcome in pictures.COLORS},
        held=[done for done in found if done.case.rolling > 0.0 and done.row["ended"] == "at rest"],
        both=_both([done for done in deep if done in ended]), deep=cases.DEEP, between=cases.BETWEEN,
        gathered=len(gathered), resting=sum(done.row["ended"] == "at rest" for done in gathered),
        vanishing=boundary.vanishing(touching), touching=touching, approach=cases.APPROACH,
        rows=list(_starts(found)),
        pairs=_pairs(laws), waves=waves,
        rates={
            words: ends
            for name, words in WAVES.items()
            if (ends := _ends(w["rate per path"] for w in waves if w["outcome"] == name))
        },
        growth=list(_growth(free)),
        missing=[case.name for case in wanted if case not in [done.case for done in ended]], wanted=len(wanted),
        begun=[done for done in (*found, *deep) if done not in ended],
        command=command("collective", quick), minutes=sum(done.row["seconds"] for done in (*found, *deep)) / 60.0,
    )  # fmt: skip


def _ends(values: Iterable[float]) -> tuple[float, ...]:
    """Return the smallest and the largest value; nothing without values."""
    known = list(values)
    return (min(known), max(known)) if known else ()


def _scenes(found: Sequence[Finished], outcome: str) -> str:
    chosen = sorted({(d.case.thickness, d.case.fraction) for d in found if d.outcome == outcome})
    by_h: dict[float, list[str]] = {}
    for h, phi in chosen:
        by_h.setdefault(h, []).append(f"{phi:g}")
    return "; ".join(f"h = {h:g} R at {', '.join(phis)}" for h, phis in by_h.items()) or "none"


AVERAGED = {
    "mean cluster": "cluster_mean", "contacts per ball": "coordination", "T/Q at first, largest": "force_over_load",
    "psi_6 at first": "hexatic_start", "psi_6 at the end": "hexatic_end", "nearest distance / R": "nearest_distance",
    "path": "path", "steps": "steps", "seconds": "seconds",
}  # fmt: skip


def _starts(found: Sequence[Finished]) -> Iterator[dict[str, Any]]:
    """Yield a row per scene: means over its starts and, for several starts, half the range of the first two columns.

    ``outcome`` and ``ended`` list all that occur.
    """
    scenes: dict[tuple[int, float, float, float], list[Finished]] = {}
    for done in found:
        case = done.case
        scenes.setdefault((case.count, case.thickness, case.fraction, case.rolling), []).append(done)
    for (count, h, phi, rolling), here in sorted(scenes.items()):
        row: dict[str, Any] = {
            "h/R": h, "area fraction": phi, "balls": count, "starts": len(here), "resistance": rolling,
            "outcome": ", ".join(sorted({done.outcome for done in here})),
            "ended": ", ".join(sorted({done.row["ended"] for done in here})),
        }  # fmt: skip
        for name, key in AVERAGED.items():
            values = [value for done in here if (value := done.row.get(key)) is not None]
            mean = float(np.mean(values)) if values else None
            several = len(values) > 1 and key in ("cluster_mean", "coordination")
            row[name] = (mean, 0.5 * float(np.ptp(values))) if several else mean
        yield row


def _pairs(laws: Mapping[float, PairLaw]) -> list[dict[str, Any]]:
    return [
        {
            "h/R": h,
            "T/Q in touch": float(law.ratio[0]),
            "least T/Q": float(law.ratio.min()),
            "at (over R)": law.farthest_apart,
            "T changes sign at (over R)": ", ".join(f"{d:.3g}" for d in law.changes) or "no distance",
            "the same over h": ", ".join(f"{d / h:.2g}" for d in law.changes) or "-",
        }
        for h, law in laws.items()
    ]


def _waves(free: Sequence[Finished], laws: Mapping[float, PairLaw]) -> Iterator[dict[str, Any]]:
    """Yield the fastest growing wave in a uniform lattice for every scene, and the outcome of its run."""
    for done in sorted(free, key=lambda done: (done.case.thickness, done.case.fraction)):
        h, phi = done.case.thickness, done.case.fraction
        wave = laws[h].wave(phi) if done.case.seed == 1 and h in laws else None
        if wave is not None:
            length = wave.length if wave.rate > 0.0 else None
            row = {"h/R": h, "area fraction": phi, "rate per path": wave.rate, "length / R": length}
            yield {**row, "outcome": done.outcome}


def _both(deep: Sequence[Finished]) -> list[dict[str, Any]]:
    """Return the pair law of each model, and the outcomes of its runs from equal starts after equal paths."""
    rows = []
    for finite in sorted({done.case.finite for done in deep}):
        law = cases.pair_law(cases.BETWEEN, cases.DEEP, finite=finite)
        row = {"model": "finite strain" if finite else "small strain", "T/Q in touch": float(law.ratio[0])}
        row["T changes sign at (over R)"] = ", ".join(f"{d:.3g}" for d in law.changes) or "no distance"
        chosen = [done for done in deep if done.case.finite == finite]
        for fraction in sorted({done.case.fraction for done in chosen}):
            ends = [done for done in chosen if done.case.fraction == fraction]
            for name, key in (("mean cluster", "cluster_mean"), ("contacts per ball", "coordination")):
                row[f"{name}, {fraction:g}"] = ", ".join(f"{done.row[key]:.3g}" for done in ends)
        rows.append(row)
    return rows


def _growth(found: Sequence[Finished]) -> Iterator[dict[str, Any]]:
    """Yield the growth laws, with the spread between seeds where there are several."""
    groups: dict[tuple[float, float, int], list[Growth]] = {}
    for done in found:
        law = growth(done)
        if law is not None:
            groups.setdefault((done.case.thickness, done.case.fraction, done.case.count), []).append(law)
    for (h, phi, count), laws in sorted(groups.items()):
        exponents = np.array([law.exponent for law in laws])
        yield {
            "h/R": h, "area fraction": phi, "balls": count, "starts fitted": len(laws),
            "exponent": float(np.mean(exponents)),
            "error of the fit": float(np.sqrt(np.mean([law.error**2 for law in laws]))),
            "spread of the starts": float(np.std(exponents, ddof=1)) if len(laws) > 1 else None,
            "clusters fitted": f"{min(g.sizes[0] for g in laws):.2g} to {max(g.sizes[1] for g in laws):.2g}",
        }  # fmt: skip


PUBLISHED = ("map.svg", "ends.png", "growth.svg", "gathering.gif")
STUDY = Study("collective", compute, page, PUBLISHED)
