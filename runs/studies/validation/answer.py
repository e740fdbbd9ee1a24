"""The study's page: one verdict per published result, then its numbers and ours."""

from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from runs.process.files import write_csv
from runs.studies.framework.case import Case
from runs.studies.framework.page import render
from runs.studies.framework.runner import study_of_cases
from runs.studies.framework.saved_cases import Found
from runs.studies.validation import flat_punch, large_strain, pictures, signs, small_strain
from runs.studies.validation.comparison import AGREES, CLOSE, CLOSE_BAND, DIFFERS, SECOND, Comparison, Groups, Point
from runs.studies.validation.sources import NOT_OPENED

COMPARISONS = (*small_strain.COMPARISONS, *flat_punch.COMPARISONS, *large_strain.COMPARISONS, *signs.COMPARISONS)
"""In the order of the page."""


def cases(quick: bool) -> list[Case]:
    """Return every case; the quick version has only those of the linear model."""
    linear = [*small_strain.cases(quick), *flat_punch.cases(quick), *signs.cases()]
    return linear if quick else [*linear, *large_strain.cases()]


def present(found: Found, folder: Path) -> str:
    """Write validation.csv and the figure; return the answer as Markdown."""
    every = {comparison.key: comparison.points(found) for comparison in COMPARISONS}
    write_csv(folder / "validation.csv", [r for c in COMPARISONS for r in _rows(c, every[c.key])])
    pictures.draw(every, folder)
    done = [c for c in COMPARISONS if _points(every[c.key])]
    return render(
        __file__, close_band=CLOSE_BAND, agreeing=(AGREES, CLOSE), differs=DIFFERS, not_opened=NOT_OPENED,
        summary=[_summary(c, every[c.key]) for c in done],
        sections=[(c, [_beside(r) for r in _rows(c, every[c.key])]) for c in done],
    )  # fmt: skip


def _points(groups: Groups) -> list[Point]:
    """Return the points of the source, without those of `SECOND` routes."""
    return [point for name, points in groups.items() if not name.startswith(SECOND) for point in points]


def _word(points: Sequence[Point]) -> str:
    verdicts = [point.verdict for point in points]
    if DIFFERS not in verdicts:
        return CLOSE if CLOSE in verdicts else AGREES
    met = len(verdicts) - verdicts.count(DIFFERS)
    return f"in {met} of {len(verdicts)} points" if met else DIFFERS


def _summary(comparison: Comparison, groups: Groups) -> dict[str, Any]:
    points = _points(groups)
    worst = max(points, key=lambda point: abs(point.off))
    return {
        "source": comparison.source.citation, "scene": comparison.scene, "our model": comparison.model,
        "points": len(points), "largest off [%]": 100.0 * worst.off, "at": worst.at, "verdict": _word(points),
    }  # fmt: skip


def _rows(comparison: Comparison, groups: Groups) -> list[dict[str, Any]]:
    return [
        {"source": comparison.key, "scene": group, **asdict(point), "off": point.off, "verdict": point.verdict}
        for group, points in groups.items()
        for point in points
    ]


def _beside(row: dict[str, Any]) -> dict[str, Any]:
    """Return a row of the CSV file in the form of the page."""
    return {
        "scene": row["scene"], "at": row["at"],
        "ours": row["ours"], "our bar [%]": 100.0 * row["bar"] / abs(row["ours"]),
        "theirs": row["theirs"], "their error [%]": 100.0 * row["error"] / abs(row["theirs"]),
        "off [%]": 100.0 * row["off"], "verdict": row["verdict"],
    }  # fmt: skip


STUDY = study_of_cases("validation", cases, present, ("validation.svg", "validation.png"))
