"""T by three routes along the load, all on one discretisation: domain integral, contact traction, slope of the energy.

The energy is taken on one mesh that is moved with the balls, so that what the mesh adds is the same at both distances.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from runs.display.numbers import attraction
from runs.studies.framework.case import Case
from runs.studies.framework.levels import Level, LevelCase
from runs.studies.framework.pair import pair
from runs.studies.framework.records import DONE, Found
from runs.studies.verification.part import COARSE, Part, claimed

NAME = "routes"
DISTANCE, SHIFT = 2.1, 0.02
"""Distance of the balls over R, and by how much each is moved either way."""
LEVELS, QUICK_LEVELS = (Level(3, 1.0), Level(4, 1.0)), (Level(2, 1.0), Level(3, 1.0))
"""The last one's answer is checked; what it changed by since the one before makes its error bar."""
FRACTIONS = (0.1, 0.2, 0.4, 0.7, 1.0)
ANSWER, APART, TOGETHER = "routes-answer", "routes-apart", "routes-together"


def cases(quick: bool) -> list[Case]:
    """Return the answer to be checked and the two runs whose energies are compared."""
    problem = pair(0.03 if quick else 0.5, distance=DISTANCE, poisson=0.3 if quick else 0.48)
    levels, steps = (QUICK_LEVELS, (1.0,)) if quick else (LEVELS, FRACTIONS)
    return [
        LevelCase(
            name, problem, "finite_strain", COARSE, labels={"part": NAME}, steps=steps,
            levels=levels[-1:] if sign else levels, shift=sign * SHIFT,
        )
        for name, sign in ((ANSWER, 0.0), (APART, 1.0), (TOGETHER, -1.0))
    ]  # fmt: skip


def rows(found: Found) -> list[dict[str, Any]]:
    """Return one row per load step: T by every route, the error bar, and the energy's departure over it."""
    if any(found.state(name) != DONE for name in (ANSWER, APART, TOGETHER)):
        return []
    slopes = energy_slopes(found.steps(APART), found.steps(TOGETHER))
    steps = found.steps(ANSWER)
    finest = [step for step in steps if _level(step) == _level(steps[-1])]
    return [_row(step, slopes[step["record"]["fraction"]]) for step in finest if step["record"]["fraction"] in slopes]


def energy_slopes(
    apart: Sequence[Mapping[str, Any]], together: Sequence[Mapping[str, Any]], shift: float = SHIFT
) -> dict[float, float]:
    """Return dU/dL [N] by load fraction; none where one of the runs has no multipliers."""
    others = {step["record"]["fraction"]: step for step in together}
    found = {}
    for step in apart:
        other = others.get(step["record"]["fraction"])
        if other is not None and step["record"]["augmented"] == other["record"]["augmented"]:
            # each ball moves by the shift, so the distance changes by four shifts between the two runs
            found[step["record"]["fraction"]] = (_energy(step) - _energy(other)) / (4.0 * shift)
    return found


def _energy(step: Mapping[str, Any]) -> float:
    """Return the energy [J] whose slope is T though the contact gives way a little.

    By the penetration g under the pressure p, the strain energy's slope is short of T by int p dg and that of the
    augmented potential long by int g dp; as p and g grow alike, their mean has neither.
    """
    return 0.5 * float(step["record"]["strain_energy"] + step["record"]["potential"])


def _level(step: Mapping[str, Any]) -> tuple[int, float]:
    return step["record"]["order"], step["record"]["fineness"]


def _row(step: Mapping[str, Any], slope: float) -> dict[str, Any]:
    ball = step["balls"][0]
    # what the mesh itself says, for the slope has no small-strain correction either: it is off by what that takes off
    answer, domain, traction = (
        attraction(step["balls"], 0, ball["tangential_force_routes"][name])
        for name in ("domain", "domain_without_pair", "traction")
    )
    error = ball["tangential_force_error"] + abs(answer - domain)
    return {
        "D": ball["approach"], "Q": ball["normal_force"], "domain": (domain, error), "traction": traction,
        "energy": slope, "traction off": traction / domain - 1.0, "energy off": slope / domain - 1.0,
        "bar": error / abs(domain), "worst": abs(slope - domain) / error,
        "verdict": claimed(abs(slope - domain) <= error, error / abs(domain)),
    }  # fmt: skip


PART = Part(
    NAME,
    "Three routes to T along the load",
    f"Thin pair (h = 1.16 R, L = {DISTANCE:g} R, nu = 0.48), T over E1 R² (T > 0 attracts) of one mesh without its "
    "small-strain correction: by domain integral (its error is the answer's and the correction), by contact traction, "
    "and by dU/dL at "
    f"fixed approach: energies of two runs whose balls, and the mesh with them, are moved by ± {SHIFT:g} R. The claim "
    "is on the energy: a mesh pins the contact to its own lines, so the traction converges more slowly and takes no "
    "part in the answer.",
    cases,
    rows,
    {
        "D": "D / R", "Q": "Q / E1 R²", "domain": "domain integral", "traction": "traction", "energy": "energy",
        "worst": "energy's departure / error bar",
    },
)  # fmt: skip
