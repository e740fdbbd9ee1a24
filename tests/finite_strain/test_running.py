"""One light run: its answer, what the observer hears, and the files that it writes."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("dolfinx")

import finite_strain
import linear_bem
from finite_strain.accuracy.error_budget import LOOSE, SHARE, discretisation
from finite_strain.output.field_catalogue import CATALOGUE
from finite_strain.planning.records import NAME, Discretisation
from finite_strain.planning.refinement import PATH_FINDER
from finite_strain.planning.run_plan import plan_run
from linear_bem import Load
from tests.finite_strain.press import ACCURACY, STEPS
from tests.finite_strain.scenes import COARSER, LIGHT, Recorder, at_small_strain, light_pair, relatively

WRITTEN_PRESSURE = 0.2
"""Discretisation: pressure is written linear on triangles, two of which span a contact radius, and never negative."""


def test_two_mirrored_balls_feel_opposite_forces_to_the_last_bit(result: Any) -> None:
    for step in result.steps:
        left, right = step.balls
        assert left.tangential_force[0] == -right.tangential_force[0] != 0.0
        assert np.abs([left.tangential_force[1], right.tangential_force[1]]).max() < 1e-12 * abs(
            left.tangential_force[0]
        )
        assert left.normal_force == right.normal_force
        for ball in step.balls:
            assert ball.tangential_force_error > 0.0
            assert set(ball.tangential_force_routes) == {"domain", "domain_without_pair", "traction"}


def test_the_error_of_t_is_the_root_of_the_squares_of_its_terms(result: Any) -> None:
    for step in result.steps:
        record = step.record
        assert set(record["error_terms"]) == set(result.solved.accuracy["terms"]) == {
            "discretisation", "enforcement", "transfer", "solver",
        }  # fmt: skip
        for number, ball in enumerate(step.balls):
            terms = [values[number] for values in record["error_terms"].values()]
            assert ball.tangential_force_error == relatively(math.hypot(*terms), 1e-9)
            assert record["tangential_force_error_at_force"][number] > 0.0
            assert 0.0 < record["normal_force_error"][number] < 0.1 * ball.normal_force
        assert record["approach_error"] == [0.0, 0.0]  # approaches are given
        assert record["imbalance"] == pytest.approx(0.0, abs=1e-18)
    accuracy = result.solved.accuracy
    assert accuracy["asked"] == ACCURACY
    assert accuracy["met"] == (accuracy["reached"] <= ACCURACY)
    last = result.balls[0]
    assert accuracy["reached"] * accuracy["relative_to"]["force"] == relatively(last.tangential_force_error, 1e-9)


def test_every_step_has_the_prescribed_approach(result: Any) -> None:
    assert [step.record["fraction"] for step in result.steps] == list(STEPS)
    assert [step.record["step"] for step in result.steps] == [1, 2]
    assert [b.approach for b in result.balls] == [relatively(LIGHT, 1e-12)] * 2
    forces = [step.balls[0].normal_force for step in result.steps]
    assert 0.0 < forces[0] < forces[1]
    assert result.steps[-1].balls == result.balls


def test_the_answer_meets_the_linear_model_under_light_load(result: Any) -> None:
    for step in result.steps:
        forces = [ball.normal_force for ball in step.balls]
        linear = linear_bem.solve(at_small_strain(light_pair()).with_load("force", forces)).balls[0]
        ball = step.balls[0]
        # theory: departures are a third of sqrt(D/R), of T measured as the run measures it
        allowed = math.sqrt(ball.approach) / 3.0 * result.solved.accuracy["relative_to"]["force"]
        difference = abs(ball.tangential_force[0] - linear.tangential_force[0])
        assert difference < allowed + ball.tangential_force_error
        assert linear.approach == relatively(ball.approach, 0.03)


def test_contact_forces_equal_the_reaction_of_the_base(result: Any) -> None:
    for step in result.steps:
        # solver: the residual is closed to 1e-7 of the normal force, or less where T is weaker
        assert step.record["force_balance"] <= 1e-7
        assert 0.0 < step.record["penetration"] < 0.03 * LIGHT
        load, pull = step.balls[0].normal_force, abs(step.balls[0].tangential_force[0])
        assert step.record["residual"] <= step.record["tolerance"]
        assert step.record["tolerance"] == relatively(min(LOOSE * load, SHARE * ACCURACY * pull), 0.2)
        assert step.record["pair_weight"] == [1.0, 1.0]
        assert 0 < step.record["tangents"] <= step.record["iterations"]
        assert step.record["augmentation_iterations"] == step.record["iterations"]  # with multipliers from the start
        assert step.record["seconds"] > 0.0
    assert result.solved.converged
    assert result.solved.certificate["force_balance"] <= 1e-7


def test_a_plan_predicts_the_number_of_unknowns(result: Any) -> None:
    plan = plan_run(light_pair(), ACCURACY, "finite_strain", steps=STEPS, numerics=COARSER)
    for mesh in result.solved.accuracy["meshes"]:
        level = Discretisation(mesh["order"], mesh["fineness"], mesh["extent"])
        assert plan.unknowns(level) == mesh["unknowns"]


def test_the_observer_receives_size_attempts_iterations_and_steps(result: Any, heard: Recorder) -> None:
    assert heard.info["unknowns"] == result.solved.unknowns
    assert heard.info["load_steps"] == len(STEPS)
    assert heard.info["resumed_steps"] == 0
    assert {attempt["mesh"] for attempt in heard.attempts} == {
        "coarse",
        "main",
        "main, small strain",
        "coarse, small strain",
    }
    assert len(heard.residuals) > result.solved.iterations
    assert len(heard.steps) == len(result.steps)
    for seen, step in zip(heard.steps, result.steps, strict=True):  # error bars also hold what later loads show
        for early, ball in zip(seen.balls, step.balls, strict=True):
            assert replace(early, tangential_force_error=ball.tangential_force_error, errors=ball.errors) == ball


def test_the_surface_handed_to_the_observer_is_the_whole_scenes(result: Any, heard: Recorder) -> None:
    surface = heard.surfaces[-1]
    low, high = surface.reference.min(axis=0), surface.reference.max(axis=0)
    assert low[:2] == pytest.approx(-high[:2])
    corners = surface.points[surface.triangles]
    assert np.isfinite(corners).all()
    flat = surface.reference[surface.triangles]
    area = 0.5 * np.linalg.norm(np.cross(flat[:, 1] - flat[:, 0], flat[:, 2] - flat[:, 0]), axis=1).sum()
    assert area == relatively(np.prod((high - low)[:2]), 1e-9)
    force = integral_over(surface.reference, surface.triangles, surface.pressure)
    assert force == relatively(sum(ball.normal_force for ball in result.balls), WRITTEN_PRESSURE)
    deepest = surface.points[np.argmin(surface.points[:, 2])]
    assert abs(abs(deepest[0]) - 1.0) < 0.1
    assert deepest[2] == relatively(-LIGHT, 0.02)  # nodes near the axis


def integral_over(points: np.ndarray, triangles: np.ndarray, values: np.ndarray) -> float:
    a, b, c = points[triangles].transpose(1, 0, 2)
    areas = 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1)
    return float(np.sum(areas * values[triangles].mean(axis=1)))


def top_triangles(mesh: Any) -> np.ndarray:
    """Return triangles (n, 3) that fill the upper ends of the hexahedra in z = 0."""
    ends = mesh.cells_dict["hexahedron"][:, 4:]
    ends = ends[np.all(np.abs(mesh.points[ends][..., 2]) < 1e-12, axis=1)]
    return np.concatenate([ends[:, [0, 1, 2]], ends[:, [0, 2, 3]]])


def test_every_step_file_opens_with_its_fields(result: Any, folder: Path) -> None:
    meshio = pytest.importorskip("meshio")
    for number, step in enumerate(result.steps, start=1):
        mesh = meshio.read(folder / f"step_{number:04d}.xdmf")
        u, p = mesh.point_data["displacement"], mesh.point_data["contact_pressure"].ravel()
        assert set(mesh.point_data) == set(CATALOGUE)
        stress = mesh.point_data["cauchy_stress"]
        assert u.shape == mesh.points.shape
        assert stress.shape == (len(mesh.points), 3, 3)
        assert np.isfinite(u).all()
        assert np.isfinite(stress).all()
        bottom = mesh.points[:, 2] < -1.16 + 1e-9
        assert bottom.any()
        assert np.abs(u[bottom]).max() < 1e-15  # roundoff
        assert p.min() >= -1e-12 * p.max()  # roundoff
        # the model holds half of one ball
        force = integral_over(mesh.points, top_triangles(mesh), p)
        assert force == relatively(0.5 * step.balls[0].normal_force, WRITTEN_PRESSURE)
        # the deepest node is on the ball's axis, and the contact is as stiff as its multipliers make it
        assert u[:, 2].min() == relatively(-step.balls[0].approach, 0.005)


def test_stress_under_the_ball_balances_the_contact_pressure(result: Any, folder: Path) -> None:
    meshio = pytest.importorskip("meshio")
    mesh = meshio.read(folder / f"step_{len(STEPS):04d}.xdmf")
    stress = mesh.point_data["cauchy_stress"]
    assert np.abs(stress - stress.transpose(0, 2, 1)).max() < 1e-12
    under_the_ball = np.argmin(np.linalg.norm(mesh.points - np.array([1.0, 0.0, 0.0]), axis=1))
    # discretisation: a few elements over a contact radius
    assert stress[under_the_ball, 2, 2] == relatively(-mesh.point_data["contact_pressure"][under_the_ball], 0.1)


def test_the_index_holds_every_step(result: Any, folder: Path) -> None:
    meshio = pytest.importorskip("meshio")
    with meshio.xdmf.TimeSeriesReader(folder / "fields.xdmf") as reader:
        points, cells = reader.read_points_cells()
        assert reader.num_steps == len(STEPS)
        assert len(cells) == 1
        dents = []
        for k in range(reader.num_steps):
            time, point_data, cell_data = reader.read_data(k)
            assert time == k + 1
            assert len(point_data["displacement"]) == len(points)
            assert "cauchy_stress" in point_data
            assert "region" in cell_data
            dents.append(point_data["displacement"][:, 2].min())
    assert dents == sorted(dents, reverse=True)


def test_a_run_with_one_answer_compares_its_meshes_at_more_loads(tmp_path: Path) -> None:
    numerics = replace(COARSER, more_loads=(0.6, 0.8))
    result = finite_strain.solve(light_pair(), accuracy=ACCURACY, folder=tmp_path, numerics=numerics)
    assert [step.record["fraction"] for step in result.steps] == [1.0]
    fine = json.loads((tmp_path / NAME).read_text(encoding="utf-8"))["discretisations"][-1]
    assert [row["own"]["fraction"] for row in fine["rows"]] == relatively([0.6, 0.8, 1.0], 1e-12)
    assert {len(changes) for changes in fine["changes"].values()} == {3}
    assert {"contact_area", "peak_pressure"} < fine["changes"].keys()
    changes, known = (np.array(fine["changes"][name]) for name in ("T", "known"))
    (share,) = discretisation(changes, Discretisation(**fine["level"]), PATH_FINDER, known[..., :2])
    term = result.steps[0].record["error_terms"]["discretisation"][0]
    assert term == relatively(share * result.balls[0].normal_force ** 2, 1e-9)


def test_the_force_of_one_ball_is_known_to_the_accuracy_asked(tmp_path: Path) -> None:
    scene = replace(light_pair(), balls=light_pair().balls[:1], load=Load("approach", light_pair().load.values[:1]))
    result = finite_strain.solve(scene, accuracy=0.05, folder=tmp_path, numerics=COARSER)
    (ball,), accuracy = result.balls, result.solved.accuracy
    assert ball.tangential_force == (0.0, 0.0)
    assert accuracy["relative_to"] == {"what": "the normal force", "force": 0.0}
    assert 0.0 < accuracy["reached"] <= 0.05
    assert ball.errors["normal_force"] == relatively(accuracy["reached"] * ball.normal_force, 1e-9)
    assert math.hypot(*accuracy["terms"].values()) == relatively(accuracy["reached"], 1e-9)
    exact = linear_bem.solve(replace(scene, finite_strain=None)).balls[0]
    assert ball.normal_force == relatively(exact.normal_force, 0.1)
    for name in ("contact_area", "peak_pressure"):
        assert 0.0 < ball.errors[name] < 0.1 * getattr(ball, name)
