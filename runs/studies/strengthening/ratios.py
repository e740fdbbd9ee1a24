"""Strengthening factors from load paths: T at finite over T at small strain, at equal force and at equal approach.

Three models add one effect at a time: paraboloid at small strain, exact sphere at small strain, finite strain. At equal
force, ``geometry`` is T of the second model over T of the first, S_Q T of the third over T of the second.
"""

import dataclasses
import hashlib
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import linear_bem
from runs.comparison import linear_states
from runs.comparison.linear_states import LinearStates
from runs.comparison.strengthening_factors import compare_steps
from runs.display.numbers import attraction
from runs.process.files import read_json, write_csv, write_text
from runs.process.json_values import to_json
from runs.studies.framework.case import Case, code_of
from runs.studies.framework.saved_cases import Found

KEPT = "ratios.json"
"""File of the study's folder with the factors of every load path: the linear states are solved once."""


def load_paths(found: Found, folder: Path) -> list[tuple[Case, list[dict[str, Any]]]]:
    """Return every finite-strain case that has answers, with its rows, see `_rows`; write factors.csv."""
    kept = read_json(folder / KEPT) or {}
    now: dict[str, dict[str, Any]] = {}
    code = code_of(*(Path(each).parent for each in (linear_bem.__file__, linear_states.__file__, __file__)))[:20]
    for case in found.cases:
        steps = found.steps(case.name)
        if case.model != "finite_strain" or not steps:
            continue
        # a finer mesh may have given new answers at the same load steps
        key = [case.key(), code, hashlib.sha256(to_json(steps).encode()).hexdigest()[:20]]
        old = kept.get(case.name, {})
        now[case.name] = old if old.get("key") == key else {"key": key, "rows": _rows(case, steps)}
    write_text(folder / KEPT, to_json(now))
    paths = [(case, now[case.name]["rows"]) for case in found.cases if case.name in now]
    if paths:
        write_csv(
            folder / "factors.csv", [{"case": case.name, **case.labels, **row} for case, path in paths for row in path]
        )
    return paths


def _rows(case: Case, steps: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """Return one row per load step of ball 0; lengths over R and forces over E1 R^2 as the problem is dimensionless."""
    linear = LinearStates(case.problem, None, {})
    at_force, at_approach = linear.along("force", steps)["steps"], linear.along("approach", steps)["steps"]
    balls = tuple(dataclasses.replace(ball, shape="paraboloid") for ball in case.problem.balls)
    paraboloids = LinearStates(dataclasses.replace(case.problem, balls=balls), None, {}).along("force", steps)["steps"]
    compared = [row for row in compare_steps(steps, at_force, at_approach) if row["ball"] == 0]
    rows = []
    for row, step, plain in zip(compared, steps, paraboloids, strict=True):
        ball = step["balls"][0]
        forces = ball["tangential_force"], row["tangential_linear"], plain["balls"][0]["tangential_force"]
        pull, linear_t, plain_t = (attraction(step["balls"], 0, force) for force in forces)
        rows.append(
            {
                "D": ball["approach"],
                "Q": ball["normal_force"],
                "a": math.sqrt(ball["contact_area"] / math.pi),
                "T": pull,
                "T_error": ball["tangential_force_error"],
                "T_linear": linear_t,
                "T_paraboloid": plain_t,
                "geometry": linear_t / plain_t
                if plain_t and math.isfinite(plain_t) and math.isfinite(linear_t)
                else None,
                "S_Q": row["strengthening_at_force"],
                "S_Q_error": row["strengthening_at_force_error"],
                "S_D": row["strengthening_at_approach"],
                "S_D_error": row["strengthening_at_approach_error"],
            }
        )
    return rows
