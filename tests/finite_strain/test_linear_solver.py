"""Newton's linear systems: chosen by size and form, the user's options win, a Krylov method that fails says so."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
import pytest

pytest.importorskip("dolfinx")

from petsc4py import PETSc

from finite_strain import lagged_factors, linear_solver, newton
from finite_strain.domain import Resolution
from finite_strain.solver_choice import choose, given_in, solver_notes
from linear_bem import Elastic, InvalidProblem, NotConverged
from tests.finite_strain.scenes import coarse_plan, coarse_rig, in_form, pair, relatively

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from pathlib import Path

    from tests.finite_strain.scenes import Rig

COARSE = Resolution(0.5, 0.5, 0.5)
DEEP = 0.3
SOLVER = 1e-7
"""The Krylov method reduces the residual by 1e-8; forces follow by the conditioning of the tangent."""
CASES = {
    "displacements, nu 0.3": ("displacement", 0.3, "fgmres + gamg"),
    "displacements, nu 0.48": ("displacement", 0.48, "fgmres + gamg"),
    "mixed, nu 0.4999": ("mixed", 0.4999, "fgmres + fieldsplit"),
}


@pytest.fixture
def options() -> Iterator[Callable[[str, str], None]]:
    """Set options of the prefix as a user would, and take them away again."""
    database = PETSc.Options("thirdbody_")
    names = []

    def give(name: str, value: str) -> None:
        names.append(name)
        database[name] = value

    yield give
    for name in names:
        database.delValue(name)


@pytest.mark.parametrize(
    ("unknowns", "mixed", "given", "method", "why"),
    [
        (149_999, False, {}, "cholesky (mumps)", "up to 150000 unknowns"),
        (150_001, False, {}, "fgmres + gamg", "more than 150000 unknowns"),
        (150_001, True, {}, "fgmres + fieldsplit", "more than 150000 unknowns"),
        (1_000, True, {"direct_up_to": "999"}, "fgmres + fieldsplit", "more than 999 unknowns"),
        (1e7, False, {"pc_type": "lu"}, "lu (mumps)", "by the options of the prefix thirdbody_"),
        (1_000, False, {"pc_type": "hypre"}, "fgmres + hypre", "by the options of the prefix thirdbody_"),
        (1_000, False, {"ksp_type": "cg"}, "cg + gamg", "by the options of the prefix thirdbody_"),
    ],
)
def test_the_solver_follows_size_form_and_the_users_options(
    unknowns: float, mixed: bool, given: dict[str, str], method: str, why: str
) -> None:
    choice = choose(unknowns, mixed, given)
    assert choice.describe() == f"{method}: {why}"


def test_a_plan_reads_the_users_options_where_petsc_does() -> None:
    line = "-log_view -thirdbody_ksp_rtol 1e-9 -thirdbody_mat_mumps_icntl_14 -1 -thirdbody_ksp_view -other 3"
    assert given_in(line) == {"ksp_rtol": "1e-9", "mat_mumps_icntl_14": "-1", "ksp_view": ""}
    assert given_in("") == {}  # no options is the usual case


def deep_rig(form: str, poisson: float, folder: Path) -> Rig:
    problem = in_form(form, pair(DEEP, poisson=poisson, substrate=None))
    return coarse_rig(coarse_plan(problem, "finite_strain", COARSE, 0.35, (0.3, 0.7, 1.0)), folder)


@pytest.mark.parametrize("case", CASES)
def test_a_deep_contact_is_solved_alike_by_factors_and_by_multigrid(
    case: str, tmp_path: Path, options: Callable[[str, str], None]
) -> None:
    form, poisson, method = CASES[case]
    forces = []
    for limit in ("1e9", "0"):
        options("direct_up_to", limit)
        rig = deep_rig(form, poisson, tmp_path)
        forces.append(rig.press()[-1].normal_forces[0])
        account = rig.solver.account()
        rig.solver.close()
    assert account["linear_solver"] == method
    # a step begins far from equilibrium, where the tangent may be indefinite: factors then take over once
    assert account["linear_fallbacks"] <= 1
    assert account["linear_iterations"] > 5
    assert account["seconds_assembly"] > 0.0
    assert account["seconds_solve"] > 0.0
    assert account["residuals"][-1] < 1e-6 * account["residuals"][0]
    assert forces[1] == relatively(forces[0], SOLVER)


@pytest.mark.parametrize("case", CASES)
def test_factors_that_serve_several_iterations_find_the_same_equilibrium_as_new_ones(
    case: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    form, poisson, _ = CASES[case]
    found = {}
    for near in (0.0, lagged_factors.NEAR):
        monkeypatch.setattr(newton, "NEAR", near)
        rig = deep_rig(form, poisson, tmp_path)
        records = rig.press()
        assert rig.solver.linear.lagged is not None
        found[near] = (
            records[-1].normal_forces[0],
            rig.solver.linear.lagged.made,
            sum(record.newton_iterations for record in records),
        )
        rig.solver.close()
    (new, made_always, iterations_always), (lagged, made, iterations) = found.values()
    assert made_always >= iterations_always  # and those of steps that were cut back
    assert made < 0.8 * made_always
    assert made < iterations
    assert lagged == relatively(new, SOLVER)


def test_old_factors_that_do_not_fit_are_replaced(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, options: Callable[[str, str], None]
) -> None:
    plan = coarse_plan(pair(0.05, poisson=0.48), "finite_strain", COARSE, 0.35)
    rig = coarse_rig(plan, tmp_path)
    expected = rig.press()[-1].normal_forces[0]
    rig.solver.close()
    monkeypatch.setattr(newton, "NEAR", math.inf)
    options("ksp_max_it", "2")
    rig = coarse_rig(plan, tmp_path)
    records = rig.press()
    assert records[-1].normal_forces[0] == relatively(expected, SOLVER)
    assert rig.solver.linear.lagged is not None
    assert rig.solver.linear.lagged.made > len(records)  # the first state of all, and more
    rig.solver.close()


@pytest.mark.parametrize(
    ("name", "value", "said"),
    [
        ("pc_type", "nonsense", "PETSc does not know what to do with -thirdbody_pc_type nonsense: "),
        (
            "pc_factor_mat_solver_type",
            "nosuch",
            "does not know what to do with .* nosuch: Could not locate solver type",
        ),
        ("snes_rtol", "1e-3", "-thirdbody_snes_rtol is not taken: .*, got 1e-3; leave it out"),
    ],
)
def test_an_option_that_cannot_be_taken_is_named(
    name: str, value: str, said: str, tmp_path: Path, options: Callable[[str, str], None]
) -> None:
    options(name, value)
    with pytest.raises(InvalidProblem, match=said):
        coarse_rig(coarse_plan(pair(0.05, poisson=0.3), "finite_strain", COARSE, 0.35), tmp_path).press()


def test_the_users_most_iterations_end_a_solve(tmp_path: Path, options: Callable[[str, str], None]) -> None:
    options("snes_max_it", "2")
    rig = coarse_rig(coarse_plan(pair(0.05, poisson=0.3), "finite_strain", COARSE, 0.35), tmp_path)
    with pytest.raises(NotConverged, match="DIVERGED_MAX_IT after 2 iterations"):
        rig.press()


def test_two_mixed_regions_are_split_into_displacement_and_both_pressures(
    tmp_path: Path, options: Callable[[str, str], None]
) -> None:
    problem = pair(0.05, poisson=0.48, substrate=Elastic(2.0, 0.48))
    forces = []
    for limit in ("1e9", "0"):
        options("direct_up_to", limit)
        rig = coarse_rig(coarse_plan(problem, "finite_strain", COARSE, 0.35), tmp_path)
        forces.append(rig.press()[-1].normal_forces[0])
        account = rig.solver.account()
        rig.solver.close()
    assert account["linear_solver"] == "fgmres + fieldsplit"
    assert account["linear_fallbacks"] == 0
    assert forces[1] == relatively(forces[0], SOLVER)


def test_factors_take_the_place_of_a_krylov_method_that_fails_and_the_record_says_so(
    tmp_path: Path, options: Callable[[str, str], None]
) -> None:
    problem = pair(0.05, poisson=0.3)
    plan = coarse_plan(problem, "finite_strain", COARSE, 0.35)
    rig = coarse_rig(plan, tmp_path)
    expected = rig.press()[-1].normal_forces[0]
    rig.solver.close()
    options("direct_up_to", "0")
    options("ksp_max_it", "2")
    rig = coarse_rig(plan, tmp_path)
    assert rig.press()[-1].normal_forces[0] == relatively(expected, SOLVER)
    b, x, r = (rig.solver.new_vector() for _ in range(3))
    rig.model.approach_derivative(rig.model.contacts, b)
    solved_before = rig.solver.effort.fallbacks
    rig.solver.solve_linear(b, x)
    rig.model.matrix.mult(x, r)
    assert np.linalg.norm(r.array - b.array) < 1e-10 * np.linalg.norm(b.array)
    assert rig.solver.effort.fallbacks == solved_before + 1
    record = rig.solver.account()
    assert record["linear_fallbacks"] == solved_before + 1 > 1
    (note,) = solver_notes([record])
    assert note.startswith(f"linear systems: fgmres + gamg did not converge {solved_before + 1} time(s)")
    assert rig.solver.account()["linear_fallbacks"] == 0
    assert not solver_notes([rig.solver.account()])


def test_a_system_that_factors_cannot_solve_either_is_said(
    tmp_path: Path, options: Callable[[str, str], None], monkeypatch: pytest.MonkeyPatch
) -> None:
    options("direct_up_to", "0")
    options("ksp_max_it", "2")
    monkeypatch.setattr(linear_solver, "FACTORS", {"ksp_type": "cg", "ksp_max_it": "1", "pc_type": "none"})
    database = PETSc.Options("thirdbody_fallback_")
    for name in ("ksp_type", "ksp_max_it", "pc_type"):
        database.delValue(name)
    rig = coarse_rig(coarse_plan(pair(0.05, poisson=0.3), "finite_strain", COARSE, 0.35), tmp_path)
    b, x = rig.solver.new_vector(), rig.solver.new_vector()
    try:
        with pytest.raises(NotConverged, match="DIVERGED_LINEAR_SOLVE"):
            rig.press()
        rig.model.tangent()
        rig.model.approach_derivative(rig.model.contacts, b)
        with pytest.raises(NotConverged, match="fgmres \\+ gamg"):
            rig.solver.solve_linear(b, x)
    finally:
        for name in ("ksp_type", "ksp_max_it", "pc_type"):
            database.delValue(name)


def test_no_option_of_ours_is_left_when_the_last_solver_is_closed(
    tmp_path: Path, options: Callable[[str, str], None]
) -> None:
    for name in PETSc.Options("thirdbody_fallback_").getAll():  # of other tests' rigs, which nobody closed
        PETSc.Options("thirdbody_fallback_").delValue(name)
    options("ksp_rtol", "1e-7")
    plan = coarse_plan(pair(0.05, poisson=0.3), "finite_strain", COARSE, 0.35)
    rig = coarse_rig(plan, tmp_path)
    assert "pc_type" in PETSc.Options("thirdbody_").getAll()
    rig.solver.linear.factors().destroy()
    linear_solver._open &= {id(rig.solver.linear)}
    rig.solver.close()
    assert PETSc.Options("thirdbody_").getAll() == {"ksp_rtol": "1e-7"}  # the user's own stays
    assert not PETSc.Options("thirdbody_fallback_").getAll()
