"""Newton's linear systems: solver choice by size and form, user options, failing Krylov methods."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

pytest.importorskip("dolfinx")

from petsc4py import PETSc

from finite_strain import Numerics
from finite_strain.equilibrium import linear_solver
from finite_strain.equilibrium.solver_options import choose, given_in, solver_notes
from linear_bem import Elastic, InvalidProblem, Load, NotConverged
from tests.finite_strain.scenes import (
    COARSER,
    at_small_strain,
    coarse_plan,
    coarse_rig,
    in_form,
    pair,
    relatively,
)

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from pathlib import Path

    from linear_bem import Problem
    from tests.finite_strain.scenes import Rig

DEEP = 0.3
SOLVER = 1e-7
"""The Krylov method reduces the residual by 1e-8; the error of forces also depends on the condition number."""
CASES = {
    "displacements, nu 0.48": ("displacement", 0.48, "fgmres + mg"),
    "mixed, nu 0.4999": ("mixed", 0.4999, "fgmres + fieldsplit"),
    "mixed, nu 0.5": ("mixed", 0.5, "fgmres + fieldsplit"),
}


@pytest.fixture
def options() -> Iterator[Callable[[str, str], None]]:
    """Set options of the prefix as a user would, and remove them afterwards."""
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
        (199_999, False, {}, "cholesky (mumps)", "up to 200 000 unknowns"),
        (200_001, False, {}, "fgmres + mg", "more than 200 000 unknowns"),
        (200_001, True, {}, "fgmres + fieldsplit", "more than 200 000 unknowns"),
        (1_000, True, {"direct_up_to": "999"}, "fgmres + fieldsplit", "more than 999 unknowns"),
        (1e7, False, {"pc_type": "lu"}, "lu (mumps)", "by the options of the prefix thirdbody_"),
        (1_000, False, {"pc_type": "hypre"}, "fgmres + hypre", "by the options of the prefix thirdbody_"),
        (1_000, False, {"ksp_type": "cg"}, "cg + mg", "by the options of the prefix thirdbody_"),
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


def rig_of(problem: Problem, folder: Path, name: str, **numerics: Any) -> Rig:
    path = folder / name
    path.mkdir()
    return coarse_rig(coarse_plan(problem, numerics=replace(COARSER, **numerics)), path)


def deep_rig(form: str, poisson: float, folder: Path, name: str, **numerics: Any) -> Rig:
    return rig_of(in_form(form, pair(DEEP, poisson=poisson)), folder, name, **numerics)


PATH = [0.5, 1.0]
STIFFEST = ["displacements, nu 0.48", "mixed, nu 0.5"]


@pytest.mark.parametrize("case", CASES)
def test_a_direct_solver_and_multigrid_agree_on_a_deep_contact(
    case: str, tmp_path: Path, options: Callable[[str, str], None]
) -> None:
    form, poisson, method = CASES[case]
    forces = []
    for limit in ("1e9", "0"):
        options("direct_up_to", limit)
        rig = deep_rig(form, poisson, tmp_path, f"limit {limit}")
        rig.press(PATH)
        effort, residuals = replace(rig.solver.effort), rig.solver.residuals
        rig.settle()  # a load step ends loosely converged
        forces.append(rig.normal_forces()[0])
        rig.solver.close()
    assert rig.solver.choice.method == method
    # far from equilibrium the tangent may be indefinite; the direct solver then takes over
    assert effort.linear_fallbacks <= 2 * len(PATH)
    assert effort.linear_iterations > 5
    assert residuals[-1] <= rig.solver.tolerance < residuals[0]
    assert forces[1] == relatively(forces[0], SOLVER)


@pytest.mark.parametrize("case", STIFFEST)
def test_a_reused_tangent_finds_the_same_equilibrium_as_new_ones(case: str, tmp_path: Path) -> None:
    form, poisson, _ = CASES[case]
    found = []
    for most in (0, Numerics().lagged_iterations):
        rig = deep_rig(form, poisson, tmp_path, f"most {most}", lagged_iterations=most)
        records = list(rig.path.steps(PATH))
        rig.settle(record=records[-1])  # a load step ends loosely converged
        tangents = sum(record.tangents for record in records)
        iterations = sum(record.newton_iterations for record in records)
        found.append((rig.normal_forces()[0], tangents, iterations))
        rig.run.close()
    (new, made_always, iterations_always), (kept, made, iterations) = found
    # an attempt whose line search fails has made a tangent for an iteration that PETSc does not count
    assert 0 < iterations_always <= made_always <= iterations_always + 1
    assert made < 0.6 * iterations
    assert iterations <= iterations_always + len(PATH)
    assert kept == relatively(new, SOLVER)


@pytest.mark.parametrize("case", CASES)
def test_the_action_is_the_product_with_the_tangent(case: str, tmp_path: Path) -> None:
    form, poisson, _ = CASES[case]
    rig = deep_rig(form, poisson, tmp_path, "one")
    rig.press(PATH[:1])
    model = rig.model
    x, product, action = (model.matrix.createVecRight() for _ in range(3))
    x.array[:] = np.random.default_rng(1).standard_normal(x.getLocalSize())
    held = [~model.constrained.ravel()]
    for bulk in model.bulks:
        if bulk.pressure is not None:
            held.append(~np.isin(np.arange(len(bulk.pressure.x.array)), bulk.idle))
    free = np.concatenate(held)
    x.array[~free] = 0.0
    model.tangent()
    model.matrix.mult(x, product)
    model.action(x, action)
    scale = np.abs(product.array_r).max()
    assert np.abs(action.array_r - product.array_r)[free].max() < 1e-10 * scale
    assert not action.array_r[~free].any()


def test_linear_systems_left_unfinished_with_an_old_tangent_do_not_prevent_equilibrium(tmp_path: Path) -> None:
    problem = pair(0.05, poisson=0.3)
    rig = rig_of(problem, tmp_path, "usual")
    rig.press()
    expected = rig.normal_forces()[0]
    rig = rig_of(problem, tmp_path, "unfinished", krylov_iterations=3)
    records = rig.press()
    assert rig.normal_forces()[0] == relatively(expected, SOLVER)
    assert sum(record.newton_iterations for record in records) > sum(record.tangents for record in records)


@pytest.mark.parametrize("limit", ["1e9", "0"], ids=["factors", "multigrid"])
def test_a_prescribed_force_is_found_with_either_solver(
    limit: str, tmp_path: Path, options: Callable[[str, str], None]
) -> None:
    options("direct_up_to", limit)
    rig = rig_of(pair(Load("force", (0.03, 0.03)), poisson=0.3), tmp_path, "force")
    rig.press()
    assert rig.normal_forces() == relatively([0.03], 1e-8)
    assert rig.solver.effort.linear_fallbacks == 0


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
        rig_of(pair(0.05, poisson=0.3), tmp_path, "one").press()


def test_the_users_iteration_limit_ends_a_solve(tmp_path: Path, options: Callable[[str, str], None]) -> None:
    options("snes_max_it", "1")
    rig = rig_of(pair(0.05, poisson=0.3), tmp_path, "one")
    with pytest.raises(NotConverged, match=r"DIVERGED_MAX_IT \(snes_max_it is 1\) after 1 iterations"):
        rig.press()


def test_options_that_no_solver_reads_are_named(tmp_path: Path, options: Callable[[str, str], None]) -> None:
    options("direct_up_to", "1e9")
    options("ksp_rtoll", "1e-3")
    options("snes_max_fail", "3")
    rig = rig_of(pair(0.05, poisson=0.3), tmp_path, "one")
    rig.press()
    assert linear_solver.unused_options() == ["ksp_rtoll"]
    (note,) = solver_notes(rig.solver.choice.method, 0, linear_solver.unused_options())
    assert note.endswith("no solver of this run (cholesky (mumps)) has read ksp_rtoll; check the spelling")


def test_two_mixed_regions_are_split_into_displacement_and_both_pressures(
    tmp_path: Path, options: Callable[[str, str], None]
) -> None:
    problem = pair(0.05, poisson=0.4999, substrate=Elastic(2.0, 0.4999))
    forces = []
    for limit in ("1e9", "0"):
        options("direct_up_to", limit)
        rig = rig_of(problem, tmp_path, f"limit {limit}")
        rig.press()
        rig.settle()
        forces.append(rig.normal_forces()[0])
        rig.solver.close()
    assert rig.solver.choice.method == "fgmres + fieldsplit"
    assert rig.solver.effort.linear_fallbacks == 0
    assert forces[1] == relatively(forces[0], SOLVER)


def test_a_direct_solver_replaces_a_failing_krylov_method_and_the_record_says_so(
    tmp_path: Path, options: Callable[[str, str], None]
) -> None:
    problem = pair(0.05, poisson=0.3)
    rig = rig_of(problem, tmp_path, "factors", growth=1.0)
    rig.press()
    expected = rig.normal_forces()[0]
    rig.solver.close()
    options("direct_up_to", "0")
    options("ksp_max_it", "2")
    rig = rig_of(problem, tmp_path, "krylov", growth=1.0)
    rig.press()
    assert rig.normal_forces()[0] == relatively(expected, SOLVER)
    count = rig.solver.effort.linear_fallbacks
    assert count > 1
    (note,) = solver_notes(rig.solver.choice.method, count, [])
    assert note.startswith(f"linear systems: fgmres + mg did not converge {count} time(s)")
    assert not solver_notes(rig.solver.choice.method, 0, [])


def test_a_system_on_which_the_direct_solver_fails_too_is_reported(
    tmp_path: Path, options: Callable[[str, str], None], monkeypatch: pytest.MonkeyPatch
) -> None:
    options("direct_up_to", "0")
    options("ksp_max_it", "2")

    def useless(solver: linear_solver.LinearSolver) -> PETSc.KSP:
        ksp = PETSc.KSP().create(solver.model.comm)
        ksp.setType("cg")
        ksp.setTolerances(max_it=1)
        ksp.setOperators(solver.model.matrix)
        ksp.getPC().setType("none")
        return ksp

    monkeypatch.setattr(linear_solver.LinearSolver, "factors", useless)
    rig = rig_of(pair(0.05, poisson=0.3), tmp_path, "one")
    with pytest.raises(NotConverged, match="DIVERGED_LINEAR_SOLVE"):
        rig.press()


@pytest.mark.parametrize("limit", ["1e9", "0"])
def test_factors_at_small_strain_keep_the_constant_part_of_the_tangent_and_multigrid_does_not(
    limit: str, tmp_path: Path, options: Callable[[str, str], None]
) -> None:
    options("direct_up_to", limit)
    rig = coarse_rig(coarse_plan(at_small_strain(pair(0.1, poisson=0.3)), "small_strain", numerics=COARSER), tmp_path)
    rig.press(PATH)
    stored = rig.model._constant
    assert (stored is None) == (limit == "0")
    rig.model.tangent(stores=False)
    once = rig.model.matrix.copy()
    rig.model.tangent(stores=True)  # from now on from the copy
    rig.model.tangent()
    once.axpy(-1.0, rig.model.matrix)
    assert once.norm() < 1e-14 * rig.model.matrix.norm()


def test_an_open_solver_leaves_the_users_options_alone_in_the_database(
    tmp_path: Path, options: Callable[[str, str], None]
) -> None:
    options("ksp_rtol", "1e-7")
    rig = rig_of(pair(0.05, poisson=0.3), tmp_path, "one")
    rig.press()
    with rig.solver.options():
        assert "pc_type" in PETSc.Options("thirdbody_").getAll()
    with pytest.raises(RuntimeError, match="of a user"), rig.solver.options():
        raise RuntimeError("of a user")
    with linear_solver.with_options({"ksp_rtol": "1e-6", "pc_type": "lu"}):
        assert linear_solver.given_options() == {"ksp_rtol": "1e-6", "pc_type": "lu"}
    assert PETSc.Options("thirdbody_").getAll() == {"ksp_rtol": "1e-7"}
