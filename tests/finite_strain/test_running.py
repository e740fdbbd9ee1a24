"""One light run: on one and two ranks, stopped and resumed, and the files that it writes."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("dolfinx")

import h5py
from scipy.spatial import cKDTree

import finite_strain
import linear_bem
from finite_strain.output.field_catalogue import CATALOGUE
from finite_strain.planning.records import NAME, Discretisation
from finite_strain.planning.run_plan import plan_run
from linear_bem.errors import OutputUnusable
from tests.finite_strain.press import ACCURACY, STEPS, STOPPED, StopAfter, Stopped
from tests.finite_strain.scenes import COARSER, LIGHT, Recorder, at_small_strain, light_pair, relatively
from tests.launch import mpirun

PARALLEL = 1e-6
"""Relative: equilibria are converged to 1e-9 of the normal force, and T is a thousandth of that force or less."""
WRITTEN_PRESSURE = 0.2
"""Discretisation: pressure is written linear on triangles, two of which span a contact radius, and never negative."""


def press(ranks: int, folder: Path, *args: str, code: int = 0, options: str = "") -> Any:
    env = {"PETSC_OPTIONS": options}
    done = mpirun(ranks, "-m", "tests.finite_strain.press", folder, *args, timeout=300.0, env=env)
    assert done.returncode == code, done.stderr
    return json.loads(done.stdout) if code == 0 else done.stdout


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("light")


@pytest.fixture(scope="module")
def heard() -> Recorder:
    return Recorder()


@pytest.fixture(scope="module")
def result(folder: Path, heard: Recorder) -> Any:
    """The light pair, solved by this process."""
    return solve(folder, heard)


def solve(folder: Path, observer: Any) -> Any:
    options = {"tangential_force": ACCURACY, "steps": STEPS, "numerics": COARSER}
    return finite_strain.solve(light_pair(), folder=folder, observer=observer, **options)


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
        # solver: the residual is closed to 1e-9 of the normal force
        assert step.record["force_balance"] <= 1e-7
        assert 0.0 < step.record["penetration"] < 0.03 * LIGHT
        assert step.record["residual"] < 1e-8 * step.balls[0].normal_force
        assert step.record["pair_weight"] == [1.0, 1.0]
        assert 0 < step.record["tangents"] <= step.record["iterations"]
        assert step.record["augmentation_iterations"] == step.record["iterations"]  # with multipliers from the start
        assert step.record["pair_iterations"] > 0
        assert step.record["seconds"] > 0.0
    assert result.solved.converged
    assert result.solved.certificate["force_balance"] <= 1e-7


def test_a_plan_predicts_the_number_of_unknowns(result: Any) -> None:
    plan = plan_run(light_pair(), ACCURACY, "finite_strain", steps=STEPS, numerics=COARSER)
    for mesh in result.solved.accuracy["meshes"]:
        level = Discretisation(mesh["order"], mesh["fineness"], mesh["extent"])
        # theory: the stated error of the estimate
        assert plan.unknowns(level) == relatively(mesh["unknowns"], 0.3)


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
    assert tuple(heard.steps) == result.steps


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


def assert_same_answer(found: Any, expected: Any, tolerance: float) -> None:
    assert len(found["steps"]) == len(expected["steps"])
    for a, b in zip(found["steps"], expected["steps"], strict=True):
        for ball, other in zip(a["balls"], b["balls"], strict=True):
            assert ball["normal_force"] == relatively(other["normal_force"], tolerance)
            assert ball["tangential_force"][0] == relatively(other["tangential_force"][0], tolerance)
            assert ball["contact_area"] == relatively(other["contact_area"], tolerance)


def same_fields(one: Path, other: Path, tolerance: float) -> None:
    with h5py.File(one) as a, h5py.File(other) as b:
        distance, row = cKDTree(b["points"][:]).query(a["points"][:])
        assert distance.max() < 1e-12
        assert len(np.unique(row)) == len(b["points"])
        for name in CATALOGUE:
            x, y = a[f"node_fields/{name}"][:], b[f"node_fields/{name}"][:][row]
            assert np.abs(x - y).max() <= tolerance * np.abs(x).max(), name


@pytest.mark.mpi
@pytest.mark.slow
@pytest.mark.parametrize("ranks", [2, 4])
def test_several_ranks_give_the_same_answer_as_one(ranks: int, result: Any, folder: Path, tmp_path: Path) -> None:
    found = press(ranks, tmp_path)
    assert found["solved"]["ranks"] == ranks
    assert found["solved"]["linear_solver"] == "cholesky (mumps)"
    assert "main" in found["meshes_run"]
    for number in (0, 1):
        name = f"mesh_{number}.msh"
        assert (tmp_path / name).read_bytes() == (folder / name).read_bytes()
    assert_same_answer(found, result.to_dict(), PARALLEL)
    for number in range(1, len(STEPS) + 1):
        same_fields(folder / f"step_{number:04d}.h5", tmp_path / f"step_{number:04d}.h5", PARALLEL)


@pytest.mark.mpi
@pytest.mark.slow
def test_a_run_stopped_in_the_middle_of_a_discretisation_resumes_there(
    result: Any, folder: Path, tmp_path: Path
) -> None:
    press(2, tmp_path, "1", code=STOPPED)
    assert (tmp_path / "step_0001.h5").exists()
    assert not (tmp_path / "step_0002.h5").exists()
    again = Recorder()
    found = solve(tmp_path, again)
    assert again.info["resumed_steps"] == 1
    # the path finder's answers and the first step on this mesh are kept
    assert {attempt["mesh"] for attempt in again.attempts} == {"main", "main, small strain"}
    assert {attempt["fraction"] for attempt in again.attempts} == {1.0}
    assert_same_answer(found.to_dict(), result.to_dict(), PARALLEL)
    same_fields(folder / "step_0002.h5", tmp_path / "step_0002.h5", PARALLEL)
    assert all(step.record["seconds_output"] > 0.0 for step in found.steps)


def test_a_finished_run_is_read_from_its_folder(result: Any, folder: Path) -> None:
    again = Recorder()
    found = solve(folder, again)
    assert not again.attempts
    assert [step.to_dict() for step in found.steps] == [step.to_dict() for step in result.steps]
    assert found.solved.accuracy == result.solved.accuracy


def test_a_run_with_a_higher_accuracy_starts_over(result: Any, folder: Path, tmp_path: Path) -> None:
    (tmp_path / NAME).write_bytes((folder / NAME).read_bytes())
    hasty = StopAfter(1)
    with pytest.raises(Stopped):
        finite_strain.solve(
            light_pair(), tangential_force=0.5 * ACCURACY, folder=tmp_path, observer=hasty, steps=STEPS,
            numerics=COARSER,
        )  # fmt: skip
    assert {attempt["mesh"] for attempt in hasty.attempts} >= {"coarse", "main"}


def test_an_unreadable_file_in_the_folder_is_named(tmp_path: Path) -> None:
    (tmp_path / NAME).write_bytes(b"{ torn")
    with pytest.raises(OutputUnusable, match=rf"{NAME} cannot be read"):
        solve(tmp_path, None)


@pytest.mark.parametrize("damaged", [NAME, "state_1_own_001.npz"])
def test_a_damaged_file_costs_a_load_step_and_not_the_run(
    damaged: str, result: Any, folder: Path, tmp_path: Path
) -> None:
    with pytest.raises(Stopped):
        solve(tmp_path, StopAfter(1))
    whole = (tmp_path / damaged).read_bytes()
    (tmp_path / damaged).write_bytes(whole[: len(whole) // 2])
    again = Recorder()
    found = solve(tmp_path, again)
    assert {attempt["mesh"] for attempt in again.attempts} == {"main", "main, small strain"}  # not the path finder's
    assert again.info["resumed_steps"] == 0
    assert any(damaged in note for note in found.solved.notes)
    assert_same_answer(found.to_dict(), result.to_dict(), PARALLEL)


def test_a_folder_that_cannot_be_made_is_refused_before_any_work(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("in the way", encoding="utf-8")
    heard = Recorder()
    with pytest.raises(OutputUnusable, match="cannot be written"):
        solve(tmp_path / "file" / "out", heard)
    assert not heard.attempts


@pytest.mark.mpi
def test_an_unreadable_file_stops_every_rank(tmp_path: Path) -> None:
    (tmp_path / NAME).write_bytes(b"")
    said = press(2, tmp_path, code=1)
    assert said.count("OutputUnusable") == 2
    assert said.count(NAME) == 2


@pytest.mark.mpi
@pytest.mark.parametrize("ranks", [1, 2])
def test_a_run_that_does_not_converge_says_so_on_every_rank(ranks: int, tmp_path: Path) -> None:
    said = press(ranks, tmp_path, "fail", code=1)
    lines = [line for line in said.splitlines() if line.startswith("rank ")]
    assert [line.split(":")[0] for line in lines] == [f"rank {rank}" for rank in range(ranks)]
    for line in lines:
        assert "NotConverged" in line
        assert "DIVERGED_MAX_IT" in line
        assert "last good state is at 0 of the full load" in line
