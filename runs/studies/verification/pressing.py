"""A load path on meshes of one family, each without the others: what a single mesh answers, nothing extrapolated.

The balls may be moved together with the mesh: energies of two such runs differ by the balls' distance alone, and the
noise of the meshes cancels in their difference.
"""

from __future__ import annotations

import dataclasses
import hashlib
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from linear_bem.problem import Problem
from linear_bem.result import BallResult, Result, Solved, Step
from runs.models import Run
from runs.studies.case import Case

if TYPE_CHECKING:
    from finite_strain.mesh_run import MeshRun
    from finite_strain.planning import RunPlan
    from meshes.box import Box, Zone

STILL = 0.7
"""Part of the mirrored prism's half-width about a ball's axis in which the mesh moves with the ball as a whole."""


@dataclass(frozen=True)
class MeshCase(Case):
    """A case solved on meshes of ``sizes`` times the planned element size, one after the other, all steps kept.

    ``shift`` [m] moves each ball of a pair away from the other, and the mesh with it.
    """

    sizes: tuple[float, ...] = (1.0,)
    shift: float = 0.0

    def key(self) -> str:
        """Return the key of `Case`, which changes with sizes and shift too."""
        return hashlib.sha256(f"{super().key()} {self.sizes} {self.shift}".encode()).hexdigest()[:20]

    def solve(self, run: Run) -> Result:
        """Press the balls in on every mesh (collective)."""
        from finite_strain.planning import plan_run  # noqa: PLC0415  (a case of finite elements)
        from finite_strain.together import working_folder  # noqa: PLC0415

        plan = plan_run(self.problem, self.accuracy, self.model)
        steps: list[Step] = []
        unknowns = 0
        with working_folder(run.folder, run.comm) as folder:
            for number, size in enumerate(self.sizes):
                driven = self._mesh(plan, size, folder / f"mesh_{number}.msh", run)
                try:
                    steps += _along(driven, size)
                    unknowns = max(unknowns, driven.model.unknowns)
                finally:
                    driven.close()
        return _result(self.model, steps, unknowns, run.comm.size)

    def _mesh(self, plan: RunPlan, size: float, file: Path, run: Run) -> MeshRun:
        from finite_strain.domain import reduce_scene  # noqa: PLC0415
        from finite_strain.mesh_run import MeshRun  # noqa: PLC0415
        from meshes.layer import write_layer_mesh  # noqa: PLC0415

        box = plan.box(size)
        if not self.shift:
            return MeshRun(plan, box, file, run.comm, run.observer, f"mesh {size:.3g}")
        problem = moved(self.problem, self.shift)
        shifted = dataclasses.replace(plan, problem=problem, reduction=reduce_scene(problem))

        def write(box: Box, path: Path) -> None:
            write_layer_mesh(box, path)
            (zone,) = box.zones  # mirrored at x = 0
            move_mesh(path, zone, STILL * zone.mirror, self.shift)

        return MeshRun(shifted, box, file, run.comm, run.observer, f"moved mesh {size:.3g}", write)


def moved(problem: Problem, shift: float) -> Problem:
    """Return a pair on the x axis with each ball ``shift`` [m] farther from the other."""
    balls = tuple(
        dataclasses.replace(b, position=(b.position[0] + np.sign(b.position[0]) * shift, b.position[1]))
        for b in problem.balls
    )
    return dataclasses.replace(problem, balls=balls)


def move_mesh(file: Path, zone: Zone, still: float, shift: float) -> None:
    """Shift the nodes of a mesh file within ``still`` of a ball's axis by ``shift`` [m] along x, those beyond by less.

    From the edge of the prism in which the mesh mirrors itself on, nodes stay. The move is as symmetric about the axis
    as the mesh: the ball's own energy, larger by orders of magnitude than what the distance changes, does not feel it.
    """
    import gmsh  # noqa: PLC0415

    from meshes.layer import gmsh_session  # noqa: PLC0415

    with gmsh_session():
        gmsh.open(str(file))
        tags, points, _ = gmsh.model.mesh.getNodes()
        points = points.reshape(-1, 3)
        distance = np.linalg.norm(points[:, :2] - np.array(zone.position), axis=1)
        points[:, 0] += shift * np.clip((zone.mirror - distance) / (zone.mirror - still), 0.0, 1.0)
        for tag, point in zip(tags, points, strict=True):
            gmsh.model.mesh.setNode(int(tag), point.tolist(), [])
        gmsh.option.setNumber("Mesh.MshFileVersion", 4.1)
        gmsh.option.setNumber("Mesh.Binary", 1)
        gmsh.write(str(file))


def _along(run: MeshRun, size: float) -> list[Step]:
    steps = []
    for done in run.path.steps(list(run.plan.fractions)):
        states = run.contact_states()
        row = run.row(done, states)
        copies = 2 ** len(run.plan.reduction.planes)
        own = {"size": size, "potential": copies * run.model.energy()}
        steps.append(_step(run.plan, row, states, {**own, **run.details([done], states)}))
    return steps


def _step(plan: RunPlan, row: dict[str, Any], states: list[dict[str, float]], details: dict[str, Any]) -> Step:
    """Return what one mesh says: T by domain integral, by traction beside it, their difference as the error."""
    forces, reduction = np.array(row["normal_forces"]), plan.reduction
    per, routes = np.array(row["per_squared_force"]), np.array(row["route_difference"])
    balls = []
    for index, (image, ball) in enumerate(zip(reduction.images, plan.problem.balls, strict=True)):
        b = image.model_ball
        squared = forces[b] ** 2
        domain, traction = (
            reduction.to_scene(index, (float(squared * v[b, 0]), float(squared * v[b, 1]))) for v in (per, per + routes)
        )
        balls.append(
            BallResult(
                ball.position, ball.radius, row["approaches"][b], float(forces[b]), domain,
                float(squared * np.abs(routes[b]).max()), states[b]["peak_pressure"], states[b]["contact_area"],
                {"domain": domain, "traction": traction},
            )
        )  # fmt: skip
    return Step(tuple(balls), {"fraction": row["fraction"], **details})


def _result(model: str, steps: list[Step], unknowns: int, ranks: int) -> Result:
    from finite_strain import compat  # noqa: PLC0415

    solved = Solved(
        True, sum(step.record["iterations"] for step in steps), unknowns,
        sum(step.record["seconds"] for step in steps), ranks, compat.versions(),
    )  # fmt: skip
    return Result(model, steps[-1].balls, solved, tuple(steps))
