"""Checks `finite_strain.planning.cost`: ``python -m tests.runs.plan_calibration [CASE ...]``.

Every case runs twice, each time in a separate process: the first run compiles the forms. Printed are unknowns,
processor time and peak memory of the second run, and the ratios of planned to measured values and errors. Planned times
are multiplied by the mean of the machine's slowness before and after that run, as the speed of a shared machine changes
within seconds.
"""

import json
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from linear_bem.law import Ogden
from linear_bem.problem import Ball, FiniteStrain, Problem
from runs.process.machine import slowness
from runs.studies.framework.pair import THICK, pair, pressed

ROUGH = 0.3
"""Required accuracy, so low that the first answer meets it."""


_SHALLOW = pair(0.1, substrate=None)
_UNLIKE = (Ball((-1.0, 0.0), 1.0), Ball((1.0, 0.0), 0.6))
_TRIANGLE = tuple(Ball(place, 1.0) for place in ((-1.2, 0.0), (1.2, 0.0), (0.0, 2.0784)))
_OGDEN = FiniteStrain(Ogden((1.3, -2.0), (0.7, 0.3)))
CASES: dict[str, tuple[Problem, float, Sequence[float] | None]] = {
    "one": (pressed([Ball((0.0, 0.0), 1.0)], 0.1, 2.0, 0.3).with_load("force", (0.1,)), ROUGH, (1.0,)),
    "approach": (_SHALLOW, ROUGH, (1.0,)),
    "force": (_SHALLOW.with_load("force", (0.05, 0.05)), ROUGH, (1.0,)),
    "mixed": (pair(0.1, poisson=0.499, substrate=None), ROUGH, (1.0,)),
    "path": (pair(0.2, substrate=None), ROUGH, None),
    "unlike": (pressed(_UNLIKE, 0.15), ROUGH, (1.0,)),
    "thick": (pair(0.2, THICK, substrate=None), ROUGH, (1.0,)),
    "substrate": (pair(0.1), ROUGH, (1.0,)),
    "ogden": (replace(_SHALLOW, finite_strain=_OGDEN), ROUGH, (1.0,)),
    "order 4": (_SHALLOW, 0.002, (1.0,)),
    "triangle": (pressed(_TRIANGLE, 0.1, 1.2, 0.49).with_load("force", (0.08,) * 3), ROUGH, (1.0,)),
}
"""Problem, accuracy and load fractions of each case."""


def measure(name: str) -> dict[str, float]:
    """Solve a case and return unknowns, processor time [s], largest memory [bytes], error of the first answer."""
    import finite_strain  # noqa: PLC0415  (not at the import of the command line)
    from finite_strain.planning.forecast import chances, likely  # noqa: PLC0415
    from finite_strain.planning.run_plan import plan_run  # noqa: PLC0415

    problem, accuracy, steps = CASES[name]
    slow = [slowness()]
    slowness.cache_clear()
    began = time.process_time()
    with tempfile.TemporaryDirectory() as folder:
        solved = finite_strain.solve(
            problem, accuracy=accuracy, steps=steps, folder=Path(folder),
            fields=finite_strain.FieldChoice(names=()),
        ).solved  # fmt: skip
    seconds = time.process_time() - began
    slow.append(slowness())
    plan = plan_run(problem, accuracy, "finite_strain", steps=steps)
    meshes = solved.accuracy["meshes"]
    assert len(meshes) == len(likely(chances(plan))), f"{name}: took other discretisations than planned"
    memory = 1024.0 * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    cost = {"unknowns": meshes[-1]["unknowns"], "seconds": seconds, "memory": memory}
    return {**cost, "error": meshes[1]["reached"], "slowness": sum(slow) / 2.0}


def planned(name: str) -> dict[str, float]:
    """Return the planned values of a case in one process on the reference machine of the plans' constants."""
    from finite_strain.planning.forecast import first_error, forecast  # noqa: PLC0415
    from finite_strain.planning.run_plan import plan_run  # noqa: PLC0415

    problem, accuracy, steps = CASES[name]
    plan = plan_run(problem, accuracy, "finite_strain", steps=steps)
    said = forecast(plan, ranks=1)
    cost = {"unknowns": said["unknowns"], "seconds": said["processor_seconds"], "memory": said["memory_bytes"]}
    return {**cost, "error": first_error(plan)}


def main() -> None:
    """Measure the cases named on the command line, or all."""
    if sys.argv[1:2] == ["--measure"]:
        print(json.dumps(measure(sys.argv[2])))
        return
    titles = (
        "case | unknowns | processor time [s] | memory [MB] | planned over measured: unknowns | time | memory | error"
    )
    print(f"| {titles} |")
    print("|---|---|---|---|---|---|---|---|")
    for name in sys.argv[1:] or CASES:
        command = [sys.executable, "-m", "tests.runs.plan_calibration", "--measure", name]
        for _ in range(2):
            output = subprocess.run(command, stdout=subprocess.PIPE, text=True, check=True).stdout
        found, plan = json.loads(output.splitlines()[-1]), planned(name)
        plan["seconds"] *= found.pop("slowness")
        ratios = " | ".join(f"{plan[key] / found[key]:.2f}" for key in found)
        print(
            f"| {name} | {found['unknowns']:.0f} | {found['seconds']:.1f} | {found['memory'] / 1e6:.0f} | {ratios} |",
            flush=True,
        )


if __name__ == "__main__":
    main()
