"""One case of a study: a problem, the model that solves it, and the varied numerical parameters."""

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any

import linear_bem
from linear_bem.problem import Problem
from linear_bem.result import Result
from runs.models import MODELS, Run
from runs.session.session import ALWAYS_NAMED

FINITE, SMALL, LINEAR, POINT = "finite_strain", "small_strain", "linear_bem", "point_load"


@dataclass(frozen=True)
class Case:
    """One solve; ``name`` is unique in the study and names the case's file.

    ``accuracy`` is the relative accuracy requested of T; ``numerics`` overrides fields of `finite_strain.Numerics`;
    ``labels`` describe the case in the study's tables; ``steps`` are the load fractions with output (None: those of a
    whole load path); ``stop_after`` interrupts the run after that many load steps and resumes it from disk; ``budget``
    limits refinement ("unknowns", "seconds"); ``alone`` solves on one rank even if there are more; ``same_as`` (study,
    case) names an identical case, whose answer is reused if the folders of both studies have the same parent.
    """

    name: str
    problem: Problem
    model: str
    accuracy: float
    labels: Mapping[str, Any] = field(default_factory=dict)
    steps: Sequence[float] | None = (1.0,)
    stop_after: int | None = None
    budget: Mapping[str, float] = field(default_factory=dict)
    alone: bool = False
    numerics: Mapping[str, Any] = field(default_factory=dict)
    same_as: tuple[str, str] | None = None

    @property
    def parallel(self) -> bool:
        """Whether all ranks solve the case together."""
        return MODELS[self.model].parallel

    def solve(self, run: Run) -> Result:
        """Return the answer (collective if `parallel`); subclasses may compute it differently."""
        return MODELS[self.model].solve(self.problem, run)

    def key(self) -> str:
        """Return a digest that changes whenever a saved answer is no longer valid for this case."""
        varied = sorted(self.numerics.items())
        if self.parallel:
            from finite_strain import FORMAT  # noqa: PLC0415  (finite-element cases only)

            code = f"elements {FORMAT}"
        else:
            code = code_of(Path(linear_bem.__file__).parent)
        budget = sorted(self.budget.items())
        steps = None if self.steps is None else tuple(self.steps)
        said = repr((code, self.problem, self.model, self.accuracy, varied, steps, self.stop_after, budget, self.alone))
        for name, part in vars(self.problem).items():
            if part is None and name not in (*ALWAYS_NAMED, "periodic"):  # an effect added later
                said = said.replace(f", {name}=None", "")
        return hashlib.sha256(said.encode()).hexdigest()[:20]


@cache
def code_of(*folders: Path) -> str:
    """Return a digest of the code and scenes in ``folders``, computed once per process."""
    digest = hashlib.sha256()
    for folder in folders:
        for file in sorted(folder.rglob("*")):
            if file.suffix in (".py", ".toml"):
                digest.update(file.read_bytes())
    return digest.hexdigest()
