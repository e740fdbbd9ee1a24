"""The cases of the part on laws: the paper's pair with every law, and the paper's balls on foam."""

from dataclasses import replace

from linear_bem.law import Hyperfoam, Law
from linear_bem.problem import FiniteStrain
from runs.studies.framework.case import Case
from runs.studies.framework.pair import THIN
from runs.studies.strengthening.materials import FOAMS, LAWS
from runs.studies.strengthening.matrix import SIDES, along

APPROACHES, QUICK_APPROACHES = (0.1, 0.2, 0.32, 0.5), (0.01, 0.02, 0.03)
"""Approaches over R at which laws are compared."""
FOAM_THICKNESS, FOAM_APPROACHES = 8.0, (0.3, 0.6, 0.9, 1.2)
"""Thickness and approaches over R of the paper's balls on foam (20 mm on 80 mm; study `experiments`)."""
ACCURACY, QUICK_ACCURACY = 0.02, 0.2


def law_cases(quick: bool) -> list[Case]:
    """Return all cases; two laws on the thin layer at light loads in the quick version."""
    if quick:
        return [_case("laws", THIN, QUICK_APPROACHES, QUICK_ACCURACY, law, nu) for law, nu in LAWS[:2]]
    found = [_case("laws", h, APPROACHES, ACCURACY, law, nu) for h in SIDES for law, nu in LAWS]
    return found + [_case("foam", FOAM_THICKNESS, FOAM_APPROACHES, ACCURACY, law, nu) for law, nu in FOAMS]


def _case(
    group: str, thickness: float, approaches: tuple[float, ...], accuracy: float, law: Law, poisson: float
) -> Case:
    case = along(group, thickness, approaches, accuracy, poisson=poisson)
    words = f"{law.name} {law.exponents[0]:g}" if isinstance(law, Hyperfoam) else law.name
    problem = replace(case.problem, finite_strain=FiniteStrain(law))
    name = case.name.replace(group, f"{group}-{words.replace(' ', '-')}", 1)
    return replace(case, name=name, problem=problem, labels={**case.labels, "law": words})
