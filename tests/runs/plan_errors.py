"""Measures `first_error` on random scenes: ``python -m tests.runs.plan_errors FIRST LAST [small]``.

Scene number n is the same each time. Each is solved on two meshes (half a minute), with ``small`` at small strain;
scenes of more than `MOST` unknowns are left out. Printed are the expected and the reached errors, and at the end their
scatter and the share of accuracies in the range `ASKED` for which the expected error gives another number of meshes. Of
scenes 1 to 35, 29 have few enough unknowns: median 1.07, scatter 0.58, 76 % within a factor 2, another number for 9 %.

The remaining scatter cannot be predicted from the scene: the reached error is the change, from order 2 to 3, of the
contribution of finite strain to T / Q^2: 0.03 to 0.65 of the change at small strain, whose sign and size (0.0005 to
0.02 of the half-space's T) vary from mesh to mesh. On soft bases the transfer of the correction reached 1.4 times the
required error. A power-law fit (room beside the contacts, half-space's T over T, thickness, element height, 1 - 2 nu)
to 85 runs of two and three balls has a scatter of 0.54, `first_error` of 0.61. In 16 scenes after the fit, the scatter
was 0.73 with the fit and 0.59 with `first_error`, which was kept.
"""

import math
import sys
import tempfile
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from linear_bem.problem import Ball, Elastic, FiniteStrain, Layer, Load, Problem

MOST = 40e3
"""Largest number of unknowns of the first answering mesh of a scene that is solved."""
ASKED = 0.003, 0.05
"""Range of required accuracies, distributed evenly in their logarithm."""
RATIOS = (0.3, 0.35, 0.4, 0.45, 0.47, 0.48, 0.49, 0.495, 0.499, 0.4999)
"""Poisson's ratios of the layer."""


def scene(number: int) -> tuple[Problem, float]:
    """Return the random problem of a number, at finite strain, and its accuracy."""
    random = np.random.default_rng(number)

    def between(low: float, high: float) -> float:
        return math.exp(random.uniform(math.log(low), math.log(high)))

    poisson, thickness = float(random.choice(RATIOS)), round(between(0.6, 3.5), 2)
    approach = min(round(between(0.05, 0.45), 3), round(0.4 * thickness, 3))
    kind = random.choice(["pair"] * 5 + ["unlike"] * 3 + ["three"])
    distance, radii = round(random.uniform(2.0, 3.0), 2), [1.0, 1.0]
    if kind == "unlike":
        radii[1] = round(random.uniform(0.6, 0.9), 2)
        distance = round(0.95 * max(distance, 1.0 + radii[1]), 2)
    balls = [Ball((side * distance / 2.0, 0.0), radius) for side, radius in zip((-1.0, 1.0), radii, strict=True)]
    if kind == "three":
        balls.append(Ball((round(random.uniform(-0.3, 0.3), 2), round(random.uniform(1.9, 2.4), 2)), 1.0))
    substrate = Elastic(round(between(2.0, 200.0), 1), 0.3) if random.uniform() < 0.25 else None
    layer, load = Layer(1.0, poisson, thickness), Load("approach", (approach,) * len(balls))
    problem, accuracy = Problem(layer, tuple(balls), load, substrate, FiniteStrain()), round(between(*ASKED), 4)
    if random.uniform() < 0.3:
        from finite_strain.geometry.load_control import prescribed  # noqa: PLC0415  (not at the import)

        force = float(f"{np.mean([ball.normal_force for ball in prescribed(problem).expected()]):.2g}")
        problem = problem.with_load("force", [force] * len(balls))
    return problem, accuracy


def measure(number: int, small: bool) -> tuple[float, float] | None:
    """Return expected and reached error of a scene's first answer; None if it has too many unknowns."""
    import finite_strain  # noqa: PLC0415  (not at the import)
    from finite_strain.planning.forecast import first_error  # noqa: PLC0415
    from finite_strain.planning.refinement import FIRST  # noqa: PLC0415
    from finite_strain.planning.run_plan import model_of, plan_run  # noqa: PLC0415

    problem, accuracy = scene(number)
    problem = replace(problem, finite_strain=None) if small else problem
    plan = plan_run(problem, accuracy, model_of(problem))
    if plan.unknowns(FIRST) > MOST:
        return None
    with tempfile.TemporaryDirectory() as folder:
        solved = finite_strain.solve(
            problem, model=plan.model, accuracy=accuracy, folder=Path(folder),
            fields=finite_strain.FieldChoice(names=()), unknowns=1.05 * plan.unknowns(FIRST),
        ).solved  # fmt: skip
    return first_error(plan), solved.accuracy["meshes"][1]["reached"]


def judged(pairs: Sequence[tuple[float, float]]) -> str:
    """Return one line on the scatter of reached over expected errors."""
    expected, reached = np.log(np.array(pairs).T)
    off, low, high = reached - expected, *np.log(ASKED)
    wrong = np.abs(np.clip(reached, low, high) - np.clip(expected, low, high)).mean() / (high - low)
    near = np.mean(np.abs(off) < math.log(2.0))
    return (
        f"{len(off)} scenes: reached over expected {math.exp(np.median(off)):.2f} in the median, logarithm scatters by "
        f"{off.std():.2f}, {near:.0%} within a factor 2; another number of meshes for {wrong:.0%} of accuracies"
    )


def main() -> None:
    """Measure the scenes from the first to the last number."""
    if len(sys.argv) not in (3, 4):
        sys.exit("plan_errors needs the first and the last number of the scenes: FIRST LAST [small]")
    first, last, *more = sys.argv[1:]
    pairs = []
    for number in range(int(first), int(last) + 1):
        found = measure(number, more == ["small"])
        if found is not None:
            pairs.append(found)
            print(f"{number}: expected {found[0]:.4f}, reached {found[1]:.4f}", flush=True)
    print(judged(pairs))


if __name__ == "__main__":
    main()
