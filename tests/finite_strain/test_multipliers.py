"""Contact multipliers: what they remove, how they are added, and penalties that are raised instead."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

pytest.importorskip("dolfinx")

import finite_strain
from finite_strain import one_discretisation
from finite_strain.accuracy.answer import MOST
from finite_strain.accuracy.error_budget import LOOSE, enforcement
from finite_strain.contact.contact_energy import Penalised
from finite_strain.equilibrium.load_path import DOUBLINGS, EXACT, LoadPath, State
from finite_strain.equilibrium.newton import StepRecord
from finite_strain.geometry.estimates import PENETRATION
from finite_strain.one_discretisation import LARGEST_PENETRATION, ROUNDS, STIFFER, MeshRun
from finite_strain.planning.records import Record, save_records, saved_records
from finite_strain.refinement_loop import Refinement
from linear_bem import NotConverged
from tests.finite_strain.scenes import (
    COARSER,
    CUBIC,
    ONE_LOAD,
    QUADRATIC,
    coarse_plan,
    coarse_rig,
    light_pair,
    pair,
    quadratic_rig,
    relatively,
)


@pytest.fixture(scope="module")
def deep_without_multipliers(tmp_path_factory: pytest.TempPathFactory) -> Any:
    rig = coarse_rig(coarse_plan(pair(0.8), numerics=ONE_LOAD), tmp_path_factory.mktemp("deep"))
    *_, last = rig.path.steps(rig.plan.path)
    pull = rig.in_plane_forces()[0, 0]
    return rig, last, rig.run.state(1.0), pull, rig.model.contact.penalties.copy()


def test_without_multipliers_the_contact_is_stiffened_and_its_error_covered(
    deep_without_multipliers: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    rig, last, soft, pull, penalties = deep_without_multipliers

    starts = []

    def rejected(*_: Any, **_gradually: bool) -> None:
        starts.append(rig.model.fields.copy()[0])
        rig.model.displacement.x.array[:] *= 0.99
        raise NotConverged("the equilibrium found has other normal forces")

    monkeypatch.setattr(rig.path, "_multiply", rejected)
    monkeypatch.setattr(rig.path, "stiffer", 2.0)
    assert not rig.path.augment(last)
    assert np.array_equal(*starts)  # what was rejected is no start
    stiff, stiffer = rig.run.state(1.0), 2.0 ** (DOUBLINGS + 1)
    assert rig.model.contact.penalties == relatively(stiffer * penalties, 1e-12)
    assert 1.0 < stiff.mean_gap[0] / (soft.mean_gap[0] / stiffer) < 2.0  # more pressure is left behind with less gap
    assert last.residual <= rig.solver.tolerance
    lacking = stiff.normal_force[0] / soft.normal_force[0] - 1.0
    (share,) = enforcement(soft, None, np.zeros(1), augmented=False)
    assert 0.5 * MOST * share < lacking < MOST * share
    assert stiff.tangential_force[0, 0] / pull - 1.0 < 2.0 * MOST * share


def test_multipliers_are_added_gradually_where_they_overshoot(deep_without_multipliers: Any) -> None:
    rig, last, soft, _, penalties = deep_without_multipliers
    rig.path.resume(rig.path.history)
    record = StepRecord(last.fraction)
    assert rig.path.augment(record)  # at once, with stiffer penalties, Newton's method fails
    added = rig.run.state(1.0)
    assert rig.model.contact.penalties == relatively(2.0**DOUBLINGS * penalties, 1e-12)
    assert record.residual <= rig.solver.tolerance
    assert abs(added.mean_gap[0]) < 0.04 * abs(soft.mean_gap[0])  # stiffer penalties alone leave a sixteenth
    # the whole pressure's share of the force that penetration withholds, as the error of a soft contact bounds it
    (share,) = enforcement(soft, None, np.zeros(1), augmented=False)
    assert 0.5 * MOST * share < added.normal_force[0] / soft.normal_force[0] - 1.0 < MOST * share


def test_an_augmentation_removes_the_penetration_left_by_the_penalty(tmp_path: Path) -> None:
    rig = quadratic_rig(pair(0.1, poisson=0.3), tmp_path)
    *_, last = rig.press()
    left, force, pull = (
        rig.model.readings.mean_gaps()[0],
        rig.normal_forces()[0],
        rig.in_plane_forces()[0, 0],
    )
    assert -2.0 * PENETRATION * 0.1 < left < 0.0
    assert rig.path.augment(last)
    assert abs(rig.model.readings.mean_gaps()[0]) < 0.2 * abs(left)
    # penetration acts like a smaller approach
    assert rig.normal_forces()[0] / force - 1.0 == pytest.approx(-1.6 * left / 0.1, rel=0.3)
    assert abs(rig.in_plane_forces()[0, 0] - pull) < 0.05 * abs(pull) + 1e-5 * force
    assert 0 < last.augmentation_iterations <= last.newton_iterations


def test_multipliers_keep_the_contact_area_of_the_state_that_they_come_from(tmp_path: Path) -> None:
    rig = quadratic_rig(pair(0.1, poisson=0.3), tmp_path)
    *_, last = rig.press()
    rig.path.source = replace(rig.path.source, turning=1.0)  # at its approach a new state takes the undeformed area
    assert rig.path.augment(last)
    assert rig.model.contact.turning.value == 1.0
    assert rig.model.contact.penalised.turning == 1.0


def test_stiffer_penalties_halve_the_penetration_left_by_multipliers_and_keep_the_area(tmp_path: Path) -> None:
    rig = quadratic_rig(pair(0.2, poisson=0.3), tmp_path, ONE_LOAD)
    *_, last = rig.press()
    assert rig.run.enforce(last) == 0  # a state without multipliers stays as it is
    assert rig.path.augment(last)
    before, stiff, iterations = rig.run.state(1.0), rig.model.contact.penalties.copy(), last.newton_iterations
    assert before.penetration[0] > LARGEST_PENETRATION

    rig.solver.max_iterations, tolerance = 0, rig.solver.tolerance  # Newton's method fails
    assert rig.run.enforce(last) == 0
    assert rig.solver.tolerance == tolerance  # the error of the answer that stays
    same = rig.run.state(1.0)
    for name, value in vars(before).items():
        assert np.array_equal(getattr(same, name), value), name

    rig.solver.max_iterations = rig.plan.numerics.newton_iterations
    rounds = rig.run.enforce(last)
    after = rig.run.state(1.0)
    assert rounds > 0
    assert rig.model.contact.penalties == relatively(stiff * STIFFER**rounds, 1e-12)
    assert after.penetration[0] < 0.6 * before.penetration[0]
    assert abs(after.mean_gap[0]) < abs(before.mean_gap[0])
    # discretisation: at order 2 the contact's edge moves within its elements; 3e-4 here
    assert after.normal_force == relatively(before.normal_force, 1e-3)
    assert after.contact_area == relatively(before.contact_area, 0.01)  # half of its points are without pressure
    assert last.newton_iterations > iterations
    assert last.residual <= rig.solver.tolerance


def test_a_step_begins_with_the_penalties_asked_ahead_unless_that_fails(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    known = quadratic_rig(pair(0.2, poisson=0.3), tmp_path, ONE_LOAD)
    *_, last = known.press()
    source = known.path.source
    good = replace(known.path.history[-1], source=source)
    assert known.path.augment(last)
    monkeypatch.setattr(one_discretisation, "LARGEST_PENETRATION", 0.0)  # as often as allowed
    assert known.run.enforce(last) == ROUNDS
    spent = last.newton_iterations

    rig = quadratic_rig(pair(0.2, poisson=0.3), tmp_path, ONE_LOAD)
    rig.path.ahead, rig.path.is_rough = STIFFER**ROUNDS, True
    (record,) = rig.path.steps([1.0], lambda _: good)
    assert record.augmented
    exact = EXACT * known.normal_forces().max()
    assert record.residual > exact
    assert rig.run.enforce(record) == ROUNDS  # those from the start count
    assert record.residual <= exact
    assert rig.model.contact.penalties == relatively(known.model.contact.penalties, 1e-12)
    later, first = known.run.state(1.0), rig.run.state(1.0)
    assert first.penetration == relatively(later.penetration, 0.05)
    assert first.normal_force == relatively(later.normal_force, 1e-5)
    assert record.newton_iterations < spent
    # the next step is extrapolated from the state without multipliers, as it begins without them
    assert np.array_equal(rig.path.history[-1].values[0], source.displacement)
    assert not np.array_equal(rig.model.fields.copy()[0], source.displacement)

    again = quadratic_rig(pair(0.2, poisson=0.3), tmp_path, ONE_LOAD)
    again.path.ahead, multiply = STIFFER, again.path._multiply

    def only_as_before(source: Penalised, record: StepRecord, gradually: bool = False) -> None:
        if again.path.ahead > 1.0:
            raise NotConverged("the equilibrium found has other normal forces")
        multiply(source, record, gradually)

    monkeypatch.setattr(again.path, "_multiply", only_as_before)
    (record,) = again.path.steps([1.0], lambda _: good)
    assert record.augmented
    assert again.path.ahead == 1.0
    monkeypatch.setattr(one_discretisation, "LARGEST_PENETRATION", 1.0)
    assert again.run.enforce(record) == 0


def test_a_rough_state_ends_exact_even_where_stiffer_penalties_find_no_equilibrium(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    rig = quadratic_rig(pair(0.1, poisson=0.3), tmp_path, ONE_LOAD)
    *_, record = rig.press()
    rig.path.is_rough = True
    assert rig.path.augment(record)
    kept, newton, exact = rig.model.contact.penalties, rig.path._newton, EXACT * rig.normal_forces().max()
    assert record.residual > exact

    def only_as_soft(record: StepRecord, residual: float | None = None, keeps: bool = False) -> None:
        if keeps and residual is None:
            raise NotConverged("Newton's method stopped")
        newton(record, residual, keeps)

    monkeypatch.setattr(rig.path, "_newton", only_as_soft)
    assert rig.path.stiffen(record, STIFFER, 1) == 0
    assert rig.model.contact.penalties == relatively(kept, 1e-12)
    assert record.residual <= exact


def test_the_residual_accepted_changes_t_by_far_less_than_itself(tmp_path: Path) -> None:
    found = []
    for residual in (EXACT, LOOSE):
        rig = quadratic_rig(pair(0.2, poisson=0.3), tmp_path, ONE_LOAD)
        rig.path.residual = residual
        *_, last = rig.press()
        assert rig.path.augment(last)
        assert last.residual <= rig.solver.tolerance == relatively(residual * rig.normal_forces().max(), 0.1)
        found.append((rig.run.state(1.0).tangential_force[0, 0], last.newton_iterations))
    assert abs(found[1][0] - found[0][0]) < 0.1 * LOOSE * rig.normal_forces().max()
    assert found[1][1] < found[0][1]


def test_a_path_that_began_with_another_meshs_states_and_ends_early_is_taken_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    known = quadratic_rig(pair(0.1, poisson=0.3), tmp_path, ONE_LOAD)
    known.press([0.5])
    good = replace(known.path.history[-1], source=known.path.source)
    known.press([1.0])

    rig = quadratic_rig(pair(0.1, poisson=0.3), tmp_path, ONE_LOAD)
    (record,) = rig.path.steps([0.5], lambda _: good)
    assert record.augmented
    solve, tried, rig.path._longest = rig.path._solve, list[float](), 0.2

    def only_its_own(fraction: float, start: State | None, record: StepRecord) -> None:
        tried.append(fraction)
        if rig.path._borrowed:
            raise NotConverged("Newton's method stopped")
        solve(fraction, start, record)

    monkeypatch.setattr(rig.path, "_solve", only_its_own)
    *_, record = done = list(rig.path.steps([1.0]))
    assert all(step.fraction > 0.5 for step in done)  # what was known is not said twice
    assert record.fraction == 1.0
    assert min(tried) < 0.5
    assert rig.normal_forces() == relatively(known.normal_forces(), 1e-4)


def test_a_finer_mesh_begins_full_load_with_stiffer_penalties_if_the_coarser_one_needed_them(tmp_path: Path) -> None:
    kept = [Record(QUADRATIC, stiffened=2), Record(CUBIC)]
    save_records(tmp_path, "key", kept)
    run: Any = object.__new__(Refinement)
    run.records, _ = saved_records(tmp_path, "key")
    run.plan = SimpleNamespace(goals=(0.5, 1.0))
    path: Any = SimpleNamespace(ahead=0.0)
    path.steps = lambda fractions, _: [(*fractions, path.ahead)]
    assert list(run._steps(SimpleNamespace(path=path), [0.5, 1.0], 1)) == [(0.5, 1.0), (1.0, STIFFER)]
    assert list(run._steps(SimpleNamespace(path=path), [0.5, 1.0], 0)) == [(0.5, 1.0), (1.0, 1.0)]


def test_the_contact_of_the_pair_is_stiffened_as_often_as_that_of_the_problem(monkeypatch: pytest.MonkeyPatch) -> None:
    penalties, close = list[tuple[np.ndarray, np.ndarray]](), MeshRun.close
    stiffened, stiffen = list[bool](), LoadPath.stiffen

    def stiffening(path: LoadPath, *args: Any) -> int:
        stiffened.append(path.model.is_finite)
        return stiffen(path, *args)

    def closing(run: MeshRun) -> None:
        assert run.small is not None
        penalties.append((run.own.model.contact.penalties.copy(), run.small.model.contact.penalties.copy()))
        close(run)

    monkeypatch.setattr(MeshRun, "close", closing)
    monkeypatch.setattr(LoadPath, "stiffen", stiffening)
    monkeypatch.setattr(one_discretisation, "LARGEST_PENETRATION", 0.0)  # as often as allowed
    finite_strain.solve(light_pair(), accuracy=0.1, steps=(1.0,), numerics=COARSER)
    coarse, main = penalties
    assert coarse[0] == relatively(coarse[1], 1e-12)
    assert main[0] == relatively(main[1], 1e-12)
    assert set(stiffened) == {True, False}  # both step by step
    assert main[0].max() > 0.9 * STIFFER**ROUNDS * coarse[0].max()
