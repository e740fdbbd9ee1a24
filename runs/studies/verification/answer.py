"""The study's page: verdicts counted per part, then the tables."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from runs.process.files import write_csv
from runs.studies.framework.case import Case
from runs.studies.framework.records import ENDED, Found
from runs.studies.framework.runner import study_of_cases
from runs.studies.framework.tables import markdown
from runs.studies.verification import (
    convergence,
    experiments,
    one_ball,
    pictures,
    routes,
    small_load,
)
from runs.studies.verification.part import REFUSED, RIGHT, STOPPED, WRONG, Part, Row

PARTS = (
    one_ball.PART, small_load.PART, convergence.PART, routes.PART, experiments.PART,
)  # fmt: skip
"""In the order of the page."""
COUNTED = (
    "Only right and wrong answers are claims: a refusal or a stop gives no answer, and an answer with an error bar "
    "above 10 % claims nothing."
)


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
    lines = ["# Verification of the finite-strain model", ""]
    lines += [f"**{', '.join(f'{count} {word}' for word, count in every.items())}.** {COUNTED}", ""]
    lines += [*markdown([_verdict(part, tables[part.name], found) for part in PARTS]), ""]
    lines += ["![One ball, small loads, order of convergence, routes to T](verification.svg)"]
    for part in PARTS:
        rows = [{**row, "verdict": row["verdict"] or "-"} for row in tables[part.name]]
        columns = {**part.columns, "verdict": "verdict"}
        lines += ["", f"## {part.title}", "", part.text, "", *markdown(rows, columns)]
    return "\n".join(lines)


def _verdict(part: Part, rows: Sequence[Row], found: Found) -> dict[str, Any]:
    mine = found.of_part(part.name)
    ended = f"{sum(found.state(case.name) in ENDED for case in mine)} of {len(mine)}"
    return {"part": part.title, "cases": ended, **_counts(rows)}


def _counts(rows: Sequence[Row]) -> dict[str, int]:
    """Return how many rows have each verdict."""
    verdicts = [row["verdict"] for row in rows]
    return {word: verdicts.count(word) for word in (RIGHT, WRONG, REFUSED, STOPPED)} | {
        "without a claim": verdicts.count(None)
    }


STUDY = study_of_cases("verification", cases, present, ("verification.svg", "verification.png"), ENDED)
