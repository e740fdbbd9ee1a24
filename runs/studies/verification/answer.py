"""The study's page: one verdict per part, then the tables."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from runs.studies.records import Found
from runs.studies.tables import markdown, save_csv
from runs.studies.verification import convergence, experiments, hard, one_ball, pictures, routes, small_load, timing
from runs.studies.verification.part import Part, Row, cases_of

PARTS = (one_ball.PART, small_load.PART, convergence.PART, routes.PART, experiments.PART, hard.PART, timing.PART)
"""In the order of the page."""
ENDINGS = ("done", "refused", "not converged", "failed")
"""States that tell how a case ended: all but those that wait."""
ENDED = frozenset(ENDINGS)


def present(found: Found, folder: Path, quick: bool) -> str:
    """Write one CSV per part and the figure; return the answer as Markdown."""
    tables = {part.name: part.rows(found) for part in PARTS}
    for name, rows in tables.items():
        if rows:
            save_csv(folder / f"{name}.csv", rows)
    pictures.draw(tables, folder)
    held = [row["holds"] for rows in tables.values() for row in rows if row["holds"] is not None]
    lines = ["# Verification of the finite-strain model", ""]
    lines += [f"**{held.count(True)} of {len(held)} claims hold.**", ""]
    lines += [*markdown([_verdict(part, tables[part.name], found) for part in PARTS]), ""]
    lines += ["![One ball, small loads, order of convergence, routes to T](verification.svg)"]
    for part in PARTS:
        rows = [{**row, "holds": _word(row["holds"])} for row in tables[part.name]]
        columns = {**part.columns, "holds": "holds"}
        lines += ["", f"## {part.title}", "", part.text, "", *markdown(rows, columns)]
    return "\n".join(lines)


def _verdict(part: Part, rows: Sequence[Row], found: Found) -> dict[str, Any]:
    mine = cases_of(found, part.name)
    claims = [row["holds"] for row in rows if row["holds"] is not None]
    return {
        "part": part.title,
        "cases": f"{sum(found.state(case.name) in ENDED for case in mine)} of {len(mine)}",
        "claims": len(claims),
        "hold": claims.count(True),
        "do not": claims.count(False),
    }


def _word(holds: bool | None) -> str:
    return "-" if holds is None else "yes" if holds else "**no**"
