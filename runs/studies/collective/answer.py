"""What forms from a random start: table, phase map, pictures, growth laws, and the answer in a sentence."""

import csv
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from runs.process import signals
from runs.process.files import write_csv
from runs.session.progress import print_status
from runs.studies import Options
from runs.studies.collective import boundary, cases, pictures
from runs.studies.collective.cases import Case, PairLaw
from runs.studies.framework.study import CASES, Study, command
from runs.studies.framework.tables import markdown

Array = NDArray[np.float64]

SHOWN = Case(6.0, 0.3, 200, 1)
"""The run of the animation."""
GATHERED, GROUPED = 4.0, 1.3
"""Mean cluster (the one that a ball picked at random is in) from which a layer counts as gathered, and as grouped."""
ORDERED = 0.15
"""Growth of the mean |psi_6| from which a layer that has not gathered counts as ordered."""
GROWING = (2.0, 0.5)
"""Range of the growth law: mean clusters of this many balls up to this share of the largest at the end."""


@dataclass(frozen=True)
class Finished:
    """A run with its arrangement along the path."""

    case: Case
    row: Mapping[str, Any]
    rows: Sequence[Mapping[str, float]]

    @property
    def outcome(self) -> str:
        """What the layer has done, so far if it is interrupted: "gathers", "small groups", "orders" or "stays"."""
        if self.row["cluster_mean"] >= GATHERED:
            return "gathers"
        if self.row["cluster_mean"] >= GROUPED:
            return "small groups"
        return "orders" if self.row["hexatic_end"] - self.row["hexatic_start"] >= ORDERED else "stays"


@dataclass(frozen=True)
class Growth:
    """Cluster size ~ path^exponent: the fit of one run, its standard error, and the range of sizes fitted."""

    exponent: float
    error: float
    sizes: tuple[float, float]


def compute(folder: Path, options: Options) -> None:
    """Run every case that has not come to its end."""
    place = folder / CASES
    place.mkdir(exist_ok=True)
    for case in cases.cases(options.quick):
        signals.check()
        begun = time.process_time()
        cases.evolve(case, place, fresh=options.fresh)
        print_status(f"{case.name}: {time.process_time() - begun:.1f} s")
    for thickness in () if options.quick else boundary.THICKNESSES:
        signals.check()
        file = boundary.file_of(place, thickness)
        known = [row["h/R"] for row in boundary.read(place)]
        if options.fresh or thickness not in known:
            boundary.compute(thickness, file)


def page(folder: Path, quick: bool) -> str:
    """Write tables and figures; return the answer as Markdown."""
    wanted = cases.cases(quick)
    found = [done for case in wanted if (done := read(case, folder / CASES)) is not None]
    write_csv(folder / "collective.csv", [{**done.row, "outcome": done.outcome} for done in found])
    laws = {h: cases.pair_law(h) for h in sorted({done.case.thickness for done in found})}
    if found:
        free = [done for done in found if done.case.rolling == 0.0]
        pictures.draw_map(folder, [(d.case, d.row, d.outcome) for d in free], laws)
        pictures.draw_ends(folder, [(d.case, folder / CASES) for d in free if d.case.seed == 1])
        pictures.draw_growth(folder, [(d.case, d.rows) for d in free])
        if SHOWN in [done.case for done in free]:
            pictures.draw_gathering(folder, SHOWN, folder / CASES, laws[SHOWN.thickness].largest)
    lines = [
        sentence(found, laws),
        *rest(found),
        *boundary.lines(boundary.read(folder / CASES)),
        "",
        *table(found),
        "",
        *pair_table(laws),
        "",
        *growth_table(found),
    ]
    ended = [done.case for done in found if done.row["ended"] != "interrupted"]
    missing = [case.name for case in wanted if case not in ended]
    if missing:
        lines += ["", f"**Not there or interrupted: {len(missing)} of {len(wanted)} runs:** {', '.join(missing)}."]
    begun = [d for d in found if d.row["ended"] == "interrupted"]
    if begun:
        at = (f"{d.case.name} at a path of {d.row['path']:.2g} after {d.row['seconds']:.0f} s" for d in begun)
        lines += ["", f"Interrupted, so far: {'; '.join(at)}."]
    seconds = sum(done.row["seconds"] for done in found)
    lines += ["", f"Made by `{command('collective', quick)}` in {seconds / 60.0:.1f} minutes of processor time."]
    return "\n".join(lines)


def read(case: Case, folder: Path) -> Finished | None:
    """Return a run as far as it is there; None where it has not begun."""
    document = cases.saved(folder / case.name)
    if document is None:
        return None
    with open(folder / case.name / "structure.csv", encoding="utf-8", newline="") as file:
        rows = [{key: float(value) for key, value in row.items()} for row in csv.DictReader(file)]
    return Finished(case, cases.summary(case, document, rows), rows)


def growth(done: Finished) -> Growth | None:
    """Return the growth law of a run, fitted by least squares in logarithms; None where clusters do not grow enough."""
    size = np.array([row["cluster_mean"] for row in done.rows])
    path = np.array([row["cycle"] for row in done.rows])
    used = (size >= GROWING[0]) & (size <= GROWING[1] * size[-1]) & (path > 0.0)
    if np.sum(used) < 5 or size[used][-1] < 2.0 * size[used][0]:
        return None
    x, y = np.log(path[used]), np.log(size[used])
    fit, spread = np.polyfit(x, y, 1, cov=True)
    return Growth(float(fit[0]), float(np.sqrt(spread[0, 0])), (float(size[used][0]), float(size[used][-1])))


def sentence(found: Sequence[Finished], laws: Mapping[float, PairLaw]) -> str:
    """Return the answer."""
    found = [done for done in found if done.case.rolling == 0.0]
    if not found:
        return "No run has come to its end yet."

    def thicknesses(outcome: str) -> str:
        chosen = sorted({(d.case.thickness, d.case.fraction) for d in found if d.outcome == outcome})
        by_h: dict[float, list[float]] = {}
        for h, phi in chosen:
            by_h.setdefault(h, []).append(phi)
        return "; ".join(f"h = {h:g} R at {', '.join(f'{p:g}' for p in phis)}" for h, phis in by_h.items()) or "none"

    attract = [h for h, law in laws.items() if law.ratio[0] > 0.0]
    part = [h for h, law in laws.items() if law.ratio[0] <= 0.0]
    driven = [done.row["force_over_load"] for done in found]
    ended = [done for done in found if done.row["ended"] != "interrupted"]
    ends = [done.row["cluster_mean"] for done in ended if done.outcome == "gathers"]
    still = sum(done.outcome == "stays" for done in found)
    chains = [done.row["coordination"] for done in found if done.outcome == "small groups"]
    return (
        "**An intermediate layer gathers where T attracts touching balls "
        f"(here h >= {min(attract, default=np.nan):g} R) and orders where T separates at every distance "
        f"(h <= {max(part, default=np.nan):g} R); it stays as it is where resistance to rolling is above T/Q: without "
        f"resistance {still} of {len(found)} runs do.** The largest T/Q of a start is {min(driven):.1g} to "
        f"{max(driven):.1g}. Runs that gather (h/R at area fractions): {thicknesses('gathers')}. Runs with small "
        f"groups ({min(chains, default=np.nan):.2g} to {max(chains, default=np.nan):.2g} contacts a ball: pairs and "
        "chains): "
        f"{thicknesses('small groups')}. Runs that order: {thicknesses('orders')}. Layers that gather have clusters of "
        f"{min(ends, default=np.nan):.3g} to {max(ends, default=np.nan):.3g} balls at the end of their path (where "
        "contacts run through the whole cell, the cluster is a network). Farther apart than about 1.2 h balls separate "
        "and clusters with them: the nearer that distance is to contact, the smaller the groups in which growth slows "
        "down. Whether it ends there these paths are too short to tell."
    )


def rest(found: Sequence[Finished]) -> list[str]:
    """Return what it takes for layers that gather to come to rest; nothing without runs with resistance."""
    held = [done for done in found if done.case.rolling > 0.0 and done.row["ended"] == "at rest"]
    if not held:
        return []
    free = [d for d in found if d.case.rolling == 0.0 and d.outcome == "gathers" and d.row["ended"] != "interrupted"]
    resting = sum(d.row["ended"] == "at rest" for d in free)
    ends = "; ".join(
        f"{d.case.count} balls on h = {d.case.thickness:g} R after a path of {d.row['path']:.3g} with a mean cluster "
        f"of {d.row['cluster_mean']:.3g} ({d.row['steps']} steps, {d.row['seconds']:.0f} s)"
        for d in held
    )
    return [
        "",
        f"**Rest.** {resting or 'None'} of {len(free)} layers that gather without resistance came to rest by the end "
        "of the path; clusters of the others go on to merge and to fold, ever more slowly. With a resistance to "
        f"rolling of {held[0].case.rolling:g} of the largest T/Q of a pair nothing moves any more: {ends}.",
    ]


def table(found: Sequence[Finished]) -> list[str]:
    """Return the table of all runs."""
    names = {
        "h/R": "h/R",
        "area_fraction": "area fraction",
        "balls": "balls",
        "seed": "seed",
        "rolling": "resistance",
        "outcome": "outcome",
        "cluster_mean": "mean cluster",
        "coordination": "contacts per ball",
        "force_over_load": "T/Q at first, largest",
        "hexatic_start": "psi_6 at first",
        "hexatic_end": "psi_6 at the end",
        "nearest_distance": "nearest distance / R",
        "path": "path",
        "ended": "ended",
        "steps": "steps",
        "seconds": "seconds",
    }
    rows = [
        {**done.row, "outcome": done.outcome}
        for done in sorted(found, key=lambda d: (d.case.count, d.case.thickness, d.case.fraction, d.case.seed))
    ]
    return markdown(rows, names, digits=3)


def pair_table(laws: Mapping[float, PairLaw]) -> list[str]:
    """Return what moves two balls on each layer."""
    rows = [
        {
            "h/R": h,
            "T/Q in touch": float(law.ratio[0]),
            "T changes sign at (over R)": ", ".join(f"{d:.3g}" for d in law.changes) or "no distance",
            "the same over h": ", ".join(f"{d / h:.2g}" for d in law.changes) or "-",
        }
        for h, law in laws.items()
    ]
    return ["Two balls alone (T > 0: attraction):", "", *markdown(rows, digits=3)]


def growth_table(found: Sequence[Finished]) -> list[str]:
    """Return the growth laws, with the spread between seeds where there are several."""
    rows = []
    groups: dict[tuple[float, float, int], list[Growth]] = {}
    for done in found:
        law = growth(done) if done.case.rolling == 0.0 else None
        if law is not None:
            groups.setdefault((done.case.thickness, done.case.fraction, done.case.count), []).append(law)
    for (h, phi, count), laws in sorted(groups.items()):
        exponents = np.array([law.exponent for law in laws])
        rows.append(
            {
                "h/R": h,
                "area fraction": phi,
                "balls": count,
                "seeds": len(laws),
                "exponent": float(np.mean(exponents)),
                "error of the fit": float(np.sqrt(np.mean([law.error**2 for law in laws]))),
                "spread of the seeds": float(np.std(exponents, ddof=1)) if len(laws) > 1 else None,
                "clusters fitted": f"{min(g.sizes[0] for g in laws):.2g} to {max(g.sizes[1] for g in laws):.2g}",
            }
        )
    if not rows:
        return ["No run has clusters that grow by more than twice in the range of the fit."]
    return ["Growth: mean cluster ~ path^exponent.", "", *markdown(rows, digits=2)]


PUBLISHED = ("map.svg", "ends.png", "growth.svg", "gathering.gif")
STUDY = Study("collective", compute, page, PUBLISHED)
