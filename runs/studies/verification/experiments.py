"""The scenes of the paper's two experiments at full approach, solved as shipped."""

from pathlib import Path
from typing import Any

from runs.display.numbers import Scale
from runs.studies.framework.case import Case
from runs.studies.framework.pair import pair
from runs.studies.framework.saved_cases import Found, pull
from runs.studies.stability.judging import energy_balance, took, verdict
from runs.studies.verification.part import Part, worded

NAME = "experiments"
SCENES = Path(__file__).parents[2] / "scenes"
DIAMETERS = (7, 10, 16)
"""Diameters [mm] of the balls on 10 mm of rubber, pressed in by 1.5 mm [the paper, section 2.2]."""
ACCURACY = 0.1
DEEP = {0.3: ACCURACY, 0.48: 0.05}
"""Poisson's ratios that the thick layer is solved with, and the accuracy asked there."""


def cases(quick: bool) -> list[Case]:
    """Return both experiments' scenes; none in the quick version: the full approach is the question."""
    if quick:
        return []
    from runs.scene.scene_file import read_scene  # noqa: PLC0415  (needs pydantic)

    found = [
        _case(
            f"thin-{diameter}mm",
            f"thin: {diameter} mm balls on 10 mm, D = 1.5 mm",
            read_scene(SCENES / f"separation_{diameter}mm.toml").problem,
        )
        for diameter in DIAMETERS
    ]
    for poisson, accuracy in DEEP.items():
        # balls of 10 mm 25 mm apart pressed 12 mm into 80 mm of foam [the paper, section 2.1]
        problem = pair(1.2, 8.0, distance=2.5, poisson=poisson, substrate=None)
        words = f"thick: h = 8 R, L = 2.5 R, D = 1.2 R, nu = {poisson:g}"
        found.append(_case(f"thick-nu{poisson:g}", words, problem, accuracy))
    return found


def _case(name: str, words: str, problem: Any, accuracy: float = ACCURACY) -> Case:
    labels = {"part": NAME, "words": words, "check": None}
    return Case(f"{NAME}-{name}", problem, "finite_strain", accuracy, labels=labels, steps=None)


def rows(found: Found) -> list[dict[str, Any]]:
    """Return one row per scene: how it ended, its cost and its answer."""
    return [_row(found, case) for case in found.of_part(NAME)]


def _row(found: Found, case: Case) -> dict[str, Any]:
    steps, record = found.steps(case.name), found.records.get(case.name, {})
    ended, why = verdict(found, case.name, case.labels)
    row: dict[str, Any] = {"scene": case.labels["words"], "ended": ended, "why": why}
    row["verdict"] = worded(found, case, ended)
    if steps:
        scale, ball = Scale.of(case.problem), steps[-1]["balls"][0]
        size, error = pull(steps[-1]["balls"])
        row |= {
            "D": ball["approach"] / scale.radius,
            "Q": ball["normal_force"] / scale.force,
            "T": (size / scale.force, error / scale.force),
            "T/Q": size / ball["normal_force"],
            **took(found, case),
            "balance": energy_balance(steps),
            "unknowns": record.get("solved", {}).get("unknowns"),
            "cpu": record.get("cpu_seconds", 0.0) / 60.0,
        }
    return row


PART = Part(NAME, "The paper's experiments at full approach", cases, rows)
