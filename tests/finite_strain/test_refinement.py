"""When a run meshes again and how finely, what three meshes tell, and that a refined run is kept and continued."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import finite_strain
from finite_strain.companion import MeshRecord
from finite_strain.domain import Resolution
from finite_strain.extrapolation import (
    CAUTIOUS_ORDER,
    FORCE_RATIO_ORDER,
    force_ratio,
    gain,
    indentation,
    observed_order,
)
from finite_strain.planning import plan_run
from finite_strain.refinement import LARGEST_RATIO, LEAST_RATIO, Budget, decide, first_ratio
from linear_bem import InvalidProblem, UnsupportedProblem
from tests.finite_strain.press import ACCURACY
from tests.finite_strain.scenes import Recorder, light_pair, pair, relatively

SIZES = [1.0, 1.4, 1.96]
SLACK = 1e-9
"""Roundoff, and the bisection that finds an order."""


def law(order: float, error: float = 0.1, exact: float = 2.0) -> list[np.ndarray]:
    """Return one ball's values on three meshes that converge with an order."""
    return [np.array([[exact + error * size**order, 0.0]]) for size in SIZES]


@pytest.mark.parametrize("order", [1.2, 2.0, 2.4])
def test_three_meshes_tell_a_low_order_and_are_extrapolated_by_it(order: float) -> None:
    told = force_ratio(law(order), SIZES)
    assert told.order[0, 0] == relatively(order, 1e-6)
    assert told.value[0, 0] == relatively(2.0, 1e-6)
    assert told.error[0, 0] >= 0.1 * (1.0 - 1e-6)


def test_an_order_above_the_usual_one_is_not_trusted() -> None:
    told = force_ratio(law(4.0), SIZES)
    assert told.order[0, 0] == FORCE_RATIO_ORDER
    assert abs(told.value[0, 0] - 2.0) < told.error[0, 0]


def test_two_meshes_extrapolate_by_the_usual_order_and_doubt_by_the_cautious_one() -> None:
    told = force_ratio(law(FORCE_RATIO_ORDER)[:2], SIZES[:2])
    assert told.value[0, 0] == relatively(2.0, SLACK)
    change = 0.1 * (1.4**FORCE_RATIO_ORDER - 1.0)
    assert told.error[0, 0] == relatively(gain(CAUTIOUS_ORDER, 1.4) * change, SLACK)


@pytest.mark.parametrize("values", [(2.0, 2.1, 2.0), (2.0, 2.1, 2.15)], ids=["to and fro", "ever faster"])
def test_meshes_that_do_not_converge_steadily_are_not_extrapolated_and_doubted_more(
    values: tuple[float, float, float],
) -> None:
    told = force_ratio([np.array([[v, 0.0]]) for v in values], SIZES)
    assert math.isnan(told.order[0, 0])
    assert told.value[0, 0] == values[0]
    assert told.error[0, 0] >= gain(CAUTIOUS_ORDER, 1.4) * 0.1 * (1.0 - SLACK)


def test_a_chance_agreement_of_two_meshes_is_not_an_error_of_nothing() -> None:
    told = force_ratio([np.array([[v, 0.0]]) for v in (2.0, 2.0, 2.3)], SIZES)
    assert told.error[0, 0] == relatively(gain(CAUTIOUS_ORDER, 1.96) * 0.3, SLACK)


def test_the_order_of_unevenly_refined_meshes_is_found() -> None:
    sizes = [1.0, 1.2, 1.9]
    values = [size**2.2 for size in sizes]
    assert observed_order(values[0] - values[1], values[1] - values[2], sizes) == relatively(2.2, 1e-6)


def test_an_extrapolated_force_never_changes_its_sign() -> None:
    value, error = indentation(np.array([1e-3, 1.0]), np.array([0.5, 1.1]), 1.4)
    assert value[0] == 1e-3
    assert value[1] < 1.0
    assert np.all(error > 0.0)


def test_finer_meshes_answer_where_a_coarser_one_did() -> None:
    def row(fraction: float) -> dict[str, Any]:
        lifted = [fraction**1.5, -(fraction**2)]
        return {
            "fraction": fraction,
            "per_squared_force": [[0.2, 0.0], [0.1 + 0.01 * math.log(fraction), 0.0]],
            "normal_forces": [fraction**1.8, fraction**1.5],
            "approaches": lifted,
        }

    record = MeshRecord(1.4, rows=[row(f) for f in (0.3, 0.6, 1.0)])
    assert record.at(0.6).normal_forces == relatively([0.6**1.8, 0.6**1.5], SLACK)
    assert record.at(0.6).approaches == relatively([0.6**1.5, -(0.6**2)], SLACK)
    # it was cut back to 0.3 and came to 0.6 and 1
    assert record.goals([0.6, 1.0]) == [0.6, 1.0]
    # it was to go on to 2, and stopped at 1 after a cut-back
    assert record.goals([0.3, 0.6, 2.0]) == [0.3, 0.6, 1.0]


def meshes(*reached: float, unknowns: float = 1e4, seconds: float = 10.0) -> list[MeshRecord]:
    """Return a companion and as many finished meshes as errors are given, each 1.5 times the last one's size."""
    records = [MeshRecord(1.4, int(unknowns / 2.7), seconds / 4.0, True)]
    for number, error in enumerate(reached):
        grown = 1.5**number
        records.append(
            MeshRecord(1.0 / grown ** (1 / 3), int(unknowns * grown), seconds * grown, True, [], [], error, 1.0)
        )
    return records


def test_an_accuracy_that_is_met_ends_the_refinement() -> None:
    decision = decide(0.02, meshes(0.019), Budget(), 0.0)
    assert decision.size is None
    assert "met" in decision.why


def test_a_larger_error_is_answered_with_smaller_elements_within_bounds() -> None:
    sizes = [decide(0.02, meshes(error), Budget(unknowns=1e9), 0.0).size for error in (0.0205, 0.03, 0.04, 0.5)]
    assert all(size is not None for size in sizes)
    assert sizes[0] == relatively(1.0 / LEAST_RATIO, SLACK)
    assert sizes[0] > sizes[1] > sizes[2] > sizes[3]  # type: ignore[operator]
    assert sizes[3] == relatively(1.0 / LARGEST_RATIO, SLACK)


@pytest.mark.parametrize(
    ("budget", "name"),
    [(Budget(unknowns=1.2e4), "12000 unknowns"), (Budget(seconds=20.0), "20 s")],
    ids=["size", "time"],
)
def test_no_mesh_is_begun_that_would_pass_the_budget(budget: Budget, name: str) -> None:
    decision = decide(0.02, meshes(0.04), budget, 0.0)
    assert decision.size is None
    assert name in decision.why


def test_a_budget_between_takes_the_finest_mesh_that_it_allows() -> None:
    decision = decide(0.02, meshes(0.08), Budget(unknowns=2e4), 0.0)
    assert decision.size == relatively(0.5 ** (1.0 / 3.0), SLACK)


def test_the_default_budget_grows_with_the_scene() -> None:
    assert Budget().most_unknowns(2e4) == 6e4
    assert Budget().most_unknowns(1e5) == 2.5e5
    assert Budget(unknowns=3e4).most_unknowns(1e5) == 3e4


def test_what_no_mesh_removes_is_not_refined_for() -> None:
    decision = decide(0.02, meshes(0.04), Budget(unknowns=1e9), 0.019)
    assert decision.size is None
    assert "not the mesh's" in decision.why


def test_refinement_comes_to_an_end() -> None:
    decision = decide(1e-6, meshes(*[0.04] * 6), Budget(unknowns=1e9), 0.0)
    assert decision.size is None


def test_seconds_left_after_the_companion_bound_the_main_mesh() -> None:
    companion = MeshRecord(1.4, 5000, 10.0, True)
    assert first_ratio(1.4, companion, Budget()) == 1.4
    assert first_ratio(1.4, companion, Budget(seconds=1e4)) == 1.4
    assert LEAST_RATIO < first_ratio(1.4, companion, Budget(seconds=35.0)) < 1.4
    assert first_ratio(1.4, companion, Budget(seconds=1.0)) == LEAST_RATIO


def test_stated_unknowns_bound_the_first_mesh_too_or_are_refused() -> None:
    free = plan_run(pair(0.1), 0.02, "finite_strain").unknowns()[1]
    bounded = plan_run(pair(0.1), 0.02, "finite_strain", Budget(unknowns=0.6 * free))
    assert bounded.unknowns()[1] <= 0.6 * free
    with pytest.raises(UnsupportedProblem, match=r"accuracy\.unknowns.*got 100"):
        plan_run(pair(0.1), 0.02, "finite_strain", Budget(unknowns=100.0))
    with pytest.raises(InvalidProblem, match=r"accuracy\.seconds"):
        Budget(seconds=0.0)


def test_a_finer_mesh_is_finer_everywhere_in_the_same_box() -> None:
    plan = plan_run(pair(0.1), 0.02, "finite_strain")
    main, fine = plan.box(1.0), plan.box(0.8)
    assert (main.x, main.y, main.substrate) == (fine.x, fine.y, fine.substrate)
    assert fine.zones[0].finest == relatively(0.8 * main.zones[0].finest, SLACK)
    assert fine.estimated_tetrahedra() > 1.5 * main.estimated_tetrahedra()


REFINED = {"unknowns": 1.4e4}
ASKED = 0.015
"""What meshes as coarse as those of the lightest tests miss."""


class Killed(Exception):
    """The run was to end here."""


class KillAt(Recorder):
    """Ends the run when a mesh begins its second load step."""

    def __init__(self, mesh: str) -> None:
        super().__init__()
        self.mesh = mesh

    def attempt(self, info: dict[str, Any]) -> None:
        super().attempt(info)
        if [attempt["mesh"] for attempt in self.attempts].count(self.mesh) == 2:
            raise Killed


@pytest.fixture(scope="module")
def too_coarse() -> Iterator[None]:
    """Mesh as for a tenth of the accuracy asked for."""
    usual = Resolution.for_accuracy
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Resolution, "for_accuracy", staticmethod(lambda _: usual(ACCURACY)))
        yield


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("refined")


@pytest.fixture(scope="module")
def killed(folder: Path, too_coarse: None) -> Recorder:
    """What is heard of the light pair, on as many meshes as a small budget pays for, until a kill in the third."""
    pytest.importorskip("dolfinx")
    heard = KillAt("finer")
    with pytest.raises(Killed):
        finite_strain.solve(light_pair(), tangential_force=ASKED, folder=folder, observer=heard, **REFINED)
    return heard


@pytest.fixture(scope="module")
def heard() -> Recorder:
    return Recorder()


@pytest.fixture(scope="module")
def refined(folder: Path, killed: Recorder, heard: Recorder) -> Any:
    """The same run, continued to its end."""
    return finite_strain.solve(light_pair(), tangential_force=ASKED, folder=folder, observer=heard, **REFINED)


@pytest.mark.slow
def test_a_run_that_misses_the_accuracy_is_refined_and_tells_how_far_it_came(refined: Any, killed: Recorder) -> None:
    told = refined.solved.accuracy
    assert len(told["meshes"]) >= 3
    assert [mesh["element_size"] for mesh in told["meshes"][:2]] == [1.4, 1.0]
    unknowns = [mesh["unknowns"] for mesh in told["meshes"]]
    assert unknowns == sorted(unknowns)
    assert unknowns[-1] == refined.solved.unknowns <= REFINED["unknowns"]
    assert told["asked"] == ASKED
    assert told["met"] == (told["reached"] <= ASKED)
    ball = refined.balls[0]
    assert told["reached"] == relatively(ball.tangential_force_error / abs(ball.tangential_force[0]), SLACK)
    assert told["met"] or any("was asked for" in note for note in refined.solved.notes)
    assert {attempt["mesh"] for attempt in killed.attempts} == {"companion", "main", "finer"}
    assert json.loads(json.dumps(refined.solved.to_dict()))["accuracy"]["stopped"]


@pytest.mark.slow
def test_a_run_killed_in_its_third_mesh_goes_on_there(refined: Any, heard: Recorder) -> None:
    first = heard.attempts[0]
    assert (first["mesh"], first["fraction"]) == ("finer", 1.0)
    assert heard.info["resumed_steps"] == len(refined.steps) - 1


@pytest.mark.slow
def test_each_mesh_answers_within_the_bar_of_the_one_before(refined: Any, killed: Recorder) -> None:
    main = next(step for step in killed.steps if step.record["fraction"] == 1.0)
    a, b = main.balls[0], refined.balls[0]
    difference = abs(a.tangential_force[0] - b.tangential_force[0])
    assert difference < a.tangential_force_error + b.tangential_force_error


@pytest.mark.slow
def test_a_refined_run_is_answered_from_its_folder_without_pressing_again(refined: Any, folder: Path) -> None:
    again = Recorder()
    found = finite_strain.solve(light_pair(), tangential_force=ASKED, folder=folder, observer=again, **REFINED)
    assert not again.attempts
    assert [step.to_dict() for step in found.steps] == [step.to_dict() for step in refined.steps]
    assert found.solved.accuracy == refined.solved.accuracy


@pytest.mark.slow
@pytest.mark.parametrize("mesh", ["companion", "main"])
def test_nothing_computed_is_lost_by_a_kill_in_the_first_meshes(mesh: str, tmp_path: Path) -> None:
    pytest.importorskip("dolfinx")
    with pytest.raises(Killed):
        finite_strain.solve(light_pair(), tangential_force=ACCURACY, folder=tmp_path, observer=KillAt(mesh))
    again = Recorder()
    finite_strain.solve(light_pair(), tangential_force=ACCURACY, folder=tmp_path, observer=again)
    first = again.attempts[0]
    assert (first["mesh"], first["fraction"]) == (mesh, 1.0)  # the step before is there already
