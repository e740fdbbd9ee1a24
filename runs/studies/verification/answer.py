"""The study's page: number of verdicts per part, then the tables."""

from collections.abc import Sequence
from pathlib import Path

from runs.process.files import write_csv
from runs.studies.framework.case import Case
from runs.studies.framework.page import render
from runs.studies.framework.pair import PAPER_LOAD
from runs.studies.framework.runner import study_of_cases
from runs.studies.framework.saved_cases import Found
from runs.studies.verification import convergence, nine_balls, one_ball, pictures, routes, small_load
from runs.studies.verification.part import RIGHT, WIDEST, WRONG, Row

PARTS = (one_ball.PART, small_load.PART, convergence.PART, routes.PART, nine_balls.PART)
"""In the order of the page."""


def cases(quick: bool) -> list[Case]:
    """Return the cases of every part."""
    return [case for part in PARTS for case in part.cases(quick)]


def present(found: Found, folder: Path) -> str:
    """Write one CSV per part and the figure; return the answer as Markdown."""
    tables = {part.name: part.rows(found) for part in PARTS}
    for name, rows in tables.items():
        if rows:
            write_csv(folder / f"{name}.csv", rows)
    pictures.draw(tables, folder)
    every = _counts([row for rows in tables.values() for row in rows])
    return render(
        __file__, counts=", ".join(f"{count} {word}" for word, count in every.items()),
        widest=WIDEST,
        verdicts=[
            {"part": p.title, "cases": f"{len(found.done(p.name))} of {len(found.of_part(p.name))}"}
            | _counts(tables[p.name])
            for p in PARTS
        ],
        rows=tables,
        title={p.name: p.title for p in PARTS}, paper_load=PAPER_LOAD, band=convergence.BAND,
        floor=convergence.FLOOR, distance=routes.DISTANCE, shift=routes.SHIFT,
        nu=" and ".join(dict.fromkeys(f"{case.problem.layer.poisson:g}" for case in found.of_part(routes.NAME))),
    )  # fmt: skip


def _counts(rows: Sequence[Row]) -> dict[str, int]:
    verdicts = [row["verdict"] for row in rows]
    words = {RIGHT: RIGHT, WRONG: WRONG, "without a claim": None}
    return {word: verdicts.count(verdict) for word, verdict in words.items()}


STUDY = study_of_cases("verification", cases, present, ("verification.svg", "verification.png"))
