"""Choice of the next discretisation and end of refinement, decided from hand-made records."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from finite_strain import Numerics
from finite_strain.accuracy.answer import judge
from finite_strain.observer import Silence
from finite_strain.planning.records import (
    BEFORE,
    NAME,
    Answer,
    ContactState,
    Discretisation,
    Record,
    Row,
    save_records,
    saved_records,
)
from finite_strain.planning.refinement import (
    FIRST,
    MOST_LEVELS,
    PATH_FINDER,
    STEP,
    STIFFER,
    WIDER,
    Budget,
    account,
    decide,
)
from finite_strain.planning.run_plan import plan_run
from linear_bem.errors import OutputUnusable
from linear_bem.result import BallResult
from tests.finite_strain.scenes import CUBIC, QUADRATIC, light_pair, pair, relatively
from tests.finite_strain.test_pairs import state

FREE = Budget(unknowns=1e9)
ANSWER = Answer(
    fraction=1.0, iterations=5, tangents=1, augmentation_iterations=5, augmented=True, cuts=0,
    residual=1e-12, tolerance=1e-11, penetration=1e-6, force_balance=1e-9, smallest_volume_ratio=0.9,
    smallest_surface_stretch=0.9, smallest_seen_area=0.9, surface_crossing=0.0, distorted_at={}, strain_energy=1.0,
    linear_solver="cholesky (mumps)", linear_iterations=9, linear_fallbacks=0,
    residuals=[1e-3, 1e-12], seconds=0.3, balls=(BallResult((0.0, 1.0), 1.0, 0.1, 1.0, (0.01, 0.0), 4e-4, 2.0, 0.1),),
    step=1, linear_failure="", error_terms={"solver": [4e-4]}, pair_weight=[1.0], imbalance=0.0,
    normal_force_error=[0.0], approach_error=[0.0], tangential_force_error_at_force=[4e-4], mesh=1,
)  # fmt: skip


def size(level: Discretisation) -> float:
    """Return the unknowns of a discretisation: the cube of the nodes along an edge."""
    return 100.0 * (level.order * level.fineness * level.extent) ** 3


def record(level: Discretisation, reached: float = math.nan, seconds: float = 10.0, **terms: float) -> Record:
    """Return a finished discretisation with an error of T and the given terms."""
    named = dict.fromkeys(("discretisation", "enforcement", "transfer", "solver"), 0.0) | terms if terms else {}
    rows = [Row(state(1.0, 0.1, (0.01, 0.0)), state(1.1, 0.1, (0.01, 0.0)))]
    return Record(level, round(size(level)), seconds, True, rows, [ANSWER], {"T": [[0.01]]}, named, reached, 1e-3)


def first(reached: float, **terms: float) -> list[Record]:
    """Return the path finder and the first discretisation with an answer."""
    return [record(QUADRATIC), record(CUBIC, reached, **(terms or {"discretisation": reached}))]


def chosen(asked: float, records: list[Record], budget: Budget = FREE) -> Discretisation:
    level = decide(asked, records, budget, size)
    assert isinstance(level, Discretisation)
    return level


def end(asked: float, records: list[Record], budget: Budget = FREE) -> str:
    """Return why no discretisation follows."""
    why = decide(asked, records, budget, size)
    assert isinstance(why, str)
    return why


def test_an_error_estimate_needs_two_discretisations() -> None:
    assert PATH_FINDER == QUADRATIC
    assert chosen(0.5, [record(QUADRATIC)]) == CUBIC


def test_the_second_discretisation_does_not_depend_on_the_accuracy() -> None:
    assert FIRST == CUBIC
    assert [chosen(asked, [record(QUADRATIC)]) for asked in (1e-4, 0.5)] == [CUBIC] * 2


def test_a_mesh_that_goes_beyond_the_coarser_one_is_refined_because_full_load_has_no_error() -> None:
    plan = plan_run(pair(0.1), 0.1, "finite_strain", steps=(0.5, 1.0))
    half = replace(ANSWER, fraction=0.5, balls=2 * ANSWER.balls, error_terms={"discretisation": [4e-4] * 2})
    rows = [Row(replace(state(1.0, 0.1, (0.01, 0.0)), fraction=f)) for f in (0.5, 1.0)]
    beyond = Record(CUBIC, 10, 1.0, True, rows, [half])
    judge(plan, beyond)
    assert beyond.reached == math.inf
    assert chosen(0.1, [record(QUADRATIC), beyond]) == QUARTIC


def test_an_accuracy_that_is_met_ends_the_refinement() -> None:
    assert "met" in end(0.02, first(0.019))


QUARTIC = Discretisation(4, 1.0)


def two_meshes(reached: float) -> list[Record]:
    """Return all orders on the first mesh, and the highest on a second mesh."""
    finer = record(Discretisation(4, 1.5), reached, discretisation=reached)
    return [*first(0.6), record(QUARTIC, 0.5, discretisation=0.5), finer]


def test_the_order_is_raised_before_the_mesh_is_refined() -> None:
    for error in (0.0205, 0.5, math.inf):
        assert chosen(0.02, first(error)) == QUARTIC
        assert chosen(0.02, [*first(0.6), record(QUARTIC, error, discretisation=error)]).fineness > 1.0


def test_a_larger_error_is_answered_with_a_finer_mesh_within_bounds() -> None:
    levels = [chosen(0.02, two_meshes(error)) for error in (0.0205, 0.06, 0.1, 0.5)]
    fineness = [level.fineness for level in levels]
    assert fineness[0] == 1.5 + STEP
    assert fineness == sorted(fineness)
    assert fineness[-1] == 2.0 * 1.5
    assert all(level == replace(QUARTIC, fineness=f) for level, f in zip(levels, fineness, strict=True))
    assert all(f / STEP == round(f / STEP) for f in fineness)


def test_an_unknown_error_counts_as_large() -> None:
    assert chosen(0.02, two_meshes(math.inf)).fineness == 2.0 * 1.5


def test_a_penalty_that_limits_the_accuracy_is_made_stiffer_on_the_same_mesh() -> None:
    assert chosen(0.02, first(0.04, enforcement=0.039, discretisation=0.009)) == replace(CUBIC, penalty=STIFFER)


def test_a_stiffer_penalty_that_left_the_penetration_is_not_made_stiffer_again() -> None:
    def stiffened(level: Discretisation, *left: float) -> list[Record]:
        """Return records of ever stiffer penalties with their errors of enforcement."""
        levels = [replace(level, penalty=STIFFER**n) for n in range(len(left))]
        return [
            record(at, 0.15, enforcement=error, discretisation=0.01) for at, error in zip(levels, left, strict=True)
        ]

    start = [record(QUADRATIC)]
    assert chosen(0.02, [*start, *stiffened(CUBIC, 0.3, 0.05)]) == replace(CUBIC, penalty=STIFFER**2)
    # the order is raised with the last penalty that helped
    assert chosen(0.02, [*start, *stiffened(CUBIC, 0.3, 0.29)]) == QUARTIC
    assert chosen(0.02, [*start, *stiffened(CUBIC, 0.3, 0.05, 0.045)]) == replace(QUARTIC, penalty=STIFFER)
    assert "stiffer penalties" in end(0.02, [*first(0.2), *stiffened(QUARTIC, 0.145, 0.145)])


def test_a_state_with_nearly_inverted_elements_is_solved_on_a_finer_mesh_once() -> None:
    folded = first(0.01)
    folded[-1].resolved = False
    assert chosen(0.02, folded) == replace(CUBIC, fineness=1.0 + STEP)
    finer = record(replace(CUBIC, fineness=1.0 + STEP), 0.01, discretisation=0.01)
    assert "met" in end(0.02, [*folded, finer])
    finer.resolved = False
    assert "on a finer mesh as well" in end(0.02, [*folded, finer])


def test_the_domain_is_widened_if_refinement_does_not_reduce_the_pairs_correction() -> None:
    def after(left: float) -> Discretisation:
        better = record(QUARTIC, 0.04, transfer=left, discretisation=0.001)
        return chosen(0.02, [*first(0.05, transfer=0.05), better])

    assert after(0.04) == replace(QUARTIC, extent=WIDER)
    assert after(0.02).fineness > 1.0  # it fell with the order, so it is due to the mesh
    assert after(0.02).extent == 1.0
    # a single answer cannot tell
    assert chosen(0.02, first(0.05, transfer=0.05)) == QUARTIC


def test_a_domain_that_helped_by_being_widened_is_widened_again() -> None:
    before = [*first(0.9, transfer=0.9), record(QUARTIC, 0.9, transfer=0.9, discretisation=0.001)]
    wider = record(replace(QUARTIC, extent=WIDER), 0.2, transfer=0.2, discretisation=0.001)
    assert chosen(0.02, [*before, wider]) == replace(QUARTIC, extent=WIDER**2)


def test_the_domain_is_widened_where_the_next_order_passes_the_budget_as_long_as_this_helps() -> None:
    def following(records: list[Record], is_given: bool = False) -> Discretisation | str:
        return decide(0.02, records, Budget(unknowns=3e3), lambda level: 1e3 * level.order**3, is_given)

    before = first(0.05, transfer=0.05, discretisation=0.01)
    wider = record(replace(CUBIC, extent=WIDER), 0.04, transfer=0.04, discretisation=0.01)
    wider.unknowns = before[-1].unknowns
    assert following(before) == replace(CUBIC, extent=WIDER)
    assert following([*before, wider]) == replace(CUBIC, extent=WIDER**2)
    of_the_mesh = first(0.05, transfer=0.01, discretisation=0.05)
    unknown = first(math.inf, transfer=0.05, discretisation=0.01)
    wider.terms["transfer"] = 0.045
    for records, is_given in ((of_the_mesh, False), (unknown, False), ([*before, wider], False), (before, True)):
        assert "(order 4, fineness 1" in (why := following(records, is_given))
        assert "passes the budget" in why


def test_errors_that_refinement_cannot_reduce_end_it() -> None:
    assert "solver" in end(0.02, first(0.04, solver=0.04))


@pytest.mark.parametrize(
    ("budget", "name"),
    [(Budget(unknowns=3e3), "3 000 unknowns"), (Budget(seconds=30.0), "30 s")],
    ids=["size", "time"],
)
def test_no_discretisation_beyond_the_budget_is_started(budget: Budget, name: str) -> None:
    assert name in end(0.02, first(0.04), budget)


def test_a_limited_budget_takes_the_finest_mesh_that_it_allows() -> None:
    # a fineness of 3 would suit and has 172 800 unknowns, one of 2.5 has 100 000
    assert chosen(0.02, two_meshes(0.5), Budget(unknowns=1.2e5)).fineness == 2.5
    assert chosen(0.02, two_meshes(0.5), Budget(unknowns=1.8e5)).fineness == 3.0


def test_predicted_sizes_are_corrected_by_the_last_actual_size() -> None:
    records = first(0.5)
    records[-1].unknowns *= 2
    assert "unknowns" in end(0.02, records, Budget(unknowns=1e4))


def test_refinement_terminates() -> None:
    records = first(0.5)
    while isinstance(level := decide(1e-9, records, FREE, size), Discretisation):
        records.append(record(level, 0.5, discretisation=0.5))
    assert len(records) == MOST_LEVELS
    assert str(MOST_LEVELS) in level


def test_the_accuracy_report_is_complete() -> None:
    records = first(0.04, discretisation=0.03, transfer=0.02)
    accuracy = account(0.02, records, 1, Budget(seconds=9.0), "the money is spent", "the largest tangential force")
    assert json.loads(json.dumps(accuracy)) == accuracy
    assert (accuracy["asked"], accuracy["reached"], accuracy["met"]) == (0.02, 0.04, False)
    assert accuracy["terms"] == records[-1].terms
    assert accuracy["relative_to"] == {"what": "the largest tangential force", "force": 1e-3}
    assert accuracy["stopped"] == "the money is spent"
    assert accuracy["budget"] == {"seconds": 9.0, "unknowns": 120e3}
    assert [mesh["order"] for mesh in accuracy["meshes"]] == [2, 3]
    assert [mesh["reached"] for mesh in accuracy["meshes"]] == [None, 0.04]


def test_records_come_back_from_their_file_and_only_for_the_run_that_wrote_them(tmp_path: Any) -> None:
    records, file = first(0.04), tmp_path / "discretisations.json"
    assert saved_records(tmp_path, "mine") == ([], "")
    records[0].rows[0] = Row(records[0].rows[0].own)  # a pair that found no equilibrium
    save_records(tmp_path, "mine", records)
    written = file.read_text(encoding="utf-8")
    assert saved_records(tmp_path, "another's") == ([], "")
    back, _ = saved_records(tmp_path, "mine")
    assert [each.level for each in back] == [QUADRATIC, CUBIC]
    assert back[0].rows[0].small is None
    save_records(tmp_path, "mine", back)
    assert file.read_text(encoding="utf-8") == written
    assert back[1].steps == [ANSWER]
    assert back[1].changes == {"T": [[0.01]]}
    row = back[1].at(1.0)
    assert row is not None
    assert isinstance(row.own, ContactState)
    assert row.own.per_squared_force == relatively(np.array([[0.01, 0.0]]), 1e-12) or np.allclose(
        row.own.per_squared_force, [[0.01, 0.0]]
    )
    assert back[1].at(0.5) is None
    file.write_text("{ truncated", encoding="utf-8")
    again, note = saved_records(tmp_path, "mine")  # the file before it is kept
    assert [each.level for each in again] == [QUADRATIC, CUBIC]
    assert "discretisations.json cannot be read" in note
    assert note.endswith(f"the run continued from {BEFORE}")
    save_records(tmp_path, "mine", again)  # does not put the damaged file in the place of the good one
    file.write_text("{ truncated", encoding="utf-8")
    assert saved_records(tmp_path, "mine")[1].endswith(f"the run continued from {BEFORE}")
    file.write_text("{ truncated", encoding="utf-8")
    strange = json.loads(written)  # whole, but not what was written
    strange["discretisations"][1]["rows"] = ["a word"]
    file.write_text(json.dumps(strange), encoding="utf-8")
    assert saved_records(tmp_path, "mine")[1].endswith(f"the run continued from {BEFORE}")
    file.write_text("{ truncated", encoding="utf-8")
    nothing, note = saved_records(tmp_path, "another's")
    assert nothing == []
    assert note.endswith("the run started from the beginning")
    file.write_text("{ truncated", encoding="utf-8")
    (tmp_path / BEFORE).write_text("{ truncated", encoding="utf-8")
    with pytest.raises(OutputUnusable, match=r"discretisations\.json cannot be read"):
        saved_records(tmp_path, "mine")
    for name in (NAME, BEFORE):
        (tmp_path / name).unlink()
    assert saved_records(tmp_path, "mine") == ([], "")


def test_a_run_with_other_numerics_has_another_key(tmp_path: Path) -> None:
    pytest.importorskip("dolfinx")
    from mpi4py import MPI  # noqa: PLC0415

    from finite_strain.refinement_loop import Refinement  # noqa: PLC0415

    def key(numerics: Numerics) -> str:
        plan = plan_run(light_pair(), 0.1, "finite_strain", numerics=numerics)
        return Refinement(plan, tmp_path, MPI.COMM_SELF, Silence(), None, keep=True).key

    assert key(Numerics()) == key(Numerics(newton_iterations=25))
    changed = {name: 2 * value for name, value in vars(Numerics()).items()}
    assert len({key(Numerics(**{name: value})) for name, value in changed.items()} | {key(Numerics())}) == 9  # type: ignore[arg-type]
