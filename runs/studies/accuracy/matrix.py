"""The cases: all models and their parameters on one problem, the paper's thin pair at D = 0.1 R."""

from typing import Any

from linear_bem.result import Result
from linear_bem.solver import solve_contact
from runs.models import USUAL, Run
from runs.studies.framework.case import Case
from runs.studies.framework.levels import Level, LevelCase
from runs.studies.framework.pair import as_seen_by, pair

USUAL_CASE = "parameter-usual"
"""The case with every parameter at its default, on the coarsest discretisation that gives an answer."""
FINEST = 1e-3
"""Highest accuracy requested of the finite elements, except for the reference."""
REFERENCE_ACCURACY, REFERENCE_UNKNOWNS = 5e-4, 200e3
ALL_RANKS = "all ranks"
OWN, TRUE = "error within the model", "error against finite strain"
"""Columns: relative errors of T against a better solution of the same model, and against the finite-strain answer."""
LADDER = ("model", "accuracy asked")
"""Parameters that users set and the advice is based on; the others are internal to the solver."""
PARAMETERS: dict[str, dict[str, dict[str, Any]]] = {
    "order and fineness (3, 1)": {
        f"{order}, {fineness:g}": {"levels": (Level(order, fineness),)}
        for order, fineness in ((2, 1.0), (2, 1.5), (2, 2.0), (3, 1.5), (4, 1.0))
    },
    "penalty / planned penalty (1)": {f"{p:g}": {"levels": (Level(penalty=p),)} for p in (0.25, 4.0)},
    "extent / planned extent (1)": {f"{e:g}": {"levels": (Level(extent=e),)} for e in (1.5, 2.0)},
    "contact quadrature degree beyond twice the order (6)": {
        f"{d}": {"numerics": {"contact_degree": d}} for d in (0, 2, 12)
    },
    "largest load step of the path over the radius (0.07)": {
        f"{step:g}": {"numerics": {"largest_step": step, "more_loads": ()}} for step in (0.035, 10.0)
    },
}
"""Parameters changed one at a time, as fields of `LevelCase`; each name holds the default."""

REFERENCES = {"linear_bem": "linear-bem-reference", "small_strain": "linear-bem-reference",
              "finite_strain": "finite-strain-reference", "point_load": "linear-bem-reference"}  # fmt: skip
"""Reference for the error of each model; that of small strain is computed by another method."""


class GridCase(Case):
    """A case that `linear_bem` solves on grids alone."""

    def solve(self, run: Run) -> Result:
        """Return the answer."""
        return solve_contact(self.problem, self.accuracy, run.report, on_grids=True).result()


def cases(quick: bool) -> list[Case]:
    """Return linear models, finite elements by mesh and accuracy, parameters, the reference, and all ranks together."""
    approach = 0.015 if quick else 0.1

    def make(
        name: str, model: str, accuracy: float, parameter: str, value: Any, kind: type[Case] = Case, *,
        alone: bool = True, **more: Any,
    ) -> Case:  # fmt: skip
        labels = {"parameter": parameter, "value": value}
        alone = alone and model in ("finite_strain", "small_strain")
        return kind(name, as_seen_by(model, pair(approach)), model, accuracy, labels=labels, alone=alone, **more)

    found = [
        make("linear-bem-reference", "linear_bem", 1e-8, "reference", ""),
        make("point-load", "point_load", 0.5, "model", ""),
    ]
    asked = (1e-2, 1e-4) if quick else (1e-1, 1e-2, 1e-3, 1e-4, 1e-5)
    found += [make(f"linear-bem-{a:g}", "linear_bem", a, "accuracy asked", a) for a in asked]
    if not quick:
        grids = (1e-1, 1e-2, 1e-3, 1e-4)
        found += [
            make(f"linear-bem-grids-{a:g}", "linear_bem", a, "accuracy asked on grids", a, GridCase) for a in grids
        ]
    meshed = (0.2,) if quick else (0.1, 0.02, 0.005, FINEST)
    for model in ("finite_strain", "small_strain"):
        short = model.replace("_", "-")
        for a in meshed:  # 0.1 % exceeds the default budget of unknowns
            more: dict[str, Any] = {"budget": {"unknowns": REFERENCE_UNKNOWNS}} if a <= FINEST else {}
            found.append(make(f"{short}-{a:g}", model, a, "accuracy asked", a, **more))
    if not quick:
        found.append(make(USUAL_CASE, "finite_strain", USUAL, "default", "", LevelCase))
        for number, (parameter, values) in enumerate(PARAMETERS.items(), start=1):
            for value, turned in values.items():
                name = f"parameter-{number}-{value.replace(', ', '-')}"
                found.append(make(name, "finite_strain", USUAL, parameter, value, LevelCase, **turned))
    best, budget = (0.1, {}) if quick else (REFERENCE_ACCURACY, {"unknowns": REFERENCE_UNKNOWNS})
    found.append(make(REFERENCES["finite_strain"], "finite_strain", best, "reference", "", budget=budget))
    if not quick:
        found.append(make("finite-strain-all-ranks", "finite_strain", USUAL, ALL_RANKS, "", alone=False))
    return found
