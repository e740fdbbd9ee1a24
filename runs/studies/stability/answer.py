"""The study's page: outcome and cost of every case."""

import math
from collections import Counter
from pathlib import Path
from typing import Any

from runs.process.files import write_csv
from runs.studies.framework.case import Case
from runs.studies.framework.page import render
from runs.studies.framework.runner import study_of_cases
from runs.studies.framework.saved_cases import ENDED, Found
from runs.studies.stability.judging import energy_balance, last_good, meshed_forces, recorded, verdict
from runs.studies.stability.matrix import cases


def present(found: Found, folder: Path) -> str:
    """Write stability.csv and return the table and the counts as Markdown."""
    rows = [_row(found, case) for case in found.cases]
    write_csv(folder / "stability.csv", rows)
    return render(
        __file__, rows=rows, counts=Counter(row["ended"] for row in rows),
        numbers=[key for key in rows[0] if key not in ("why", "words")],
    )  # fmt: skip


def _row(found: Found, case: Case) -> dict[str, Any]:
    steps, record = found.steps(case.name), found.records.get(case.name, {})
    ended, why = verdict(found, case.name, case.labels)
    last = steps[-1]["balls"] if steps else []
    size = max((abs(ball["tangential_force"][0]) for ball in last), default=0.0)
    errors = [ball["tangential_force_error"] for ball in last]
    return {
        "case": case.name,
        "words": case.labels["words"],
        "ended": ended,
        "reached": last_good(steps, found.state(case.name), record.get("reason") or ""),
        "steps": len(steps) if case.parallel else None,
        "cut-backs": sum(cuts > 0 for cuts in recorded(steps, "cuts")) if case.parallel else None,
        "iterations": sum(recorded(steps, "iterations")) if case.parallel else None,
        "smallest J": min(recorded(steps, "smallest_volume_ratio"), default=math.nan),
        "penetration / R": max(recorded(steps, "penetration"), default=math.nan) / case.problem.balls[0].radius,
        "energy balance": energy_balance(steps, meshed_forces(record)),
        "T": (last[0]["tangential_force"][0], last[0]["tangential_force_error"]) if last else None,
        "error of T [%]": 100.0 * max(errors) / size if size and None not in errors else None,
        "CPU seconds": record.get("cpu_seconds"),
        "why": why,
    }


STUDY = study_of_cases("stability", cases, present, answers=ENDED)
