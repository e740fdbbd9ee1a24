"""Multigrid over the elements' order: exact interpolation, constrained rows, iterations that hardly grow."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

pytest.importorskip("dolfinx")

import dolfinx
from mpi4py import MPI
from petsc4py import PETSc
from scipy import sparse

from finite_strain import compat
from finite_strain.equilibrium import linear_solver
from finite_strain.equilibrium.order_levels import interpolation, of_order, upright
from finite_strain.equilibrium.solver_options import choose, factor_bytes
from finite_strain.geometry.estimates import penalties
from finite_strain.numerics import DEFAULT, Numerics
from finite_strain.planning.records import Discretisation
from linear_bem import NotConverged
from tests.finite_strain.scenes import COARSER, coarse_plan, coarse_rig, in_form, pair
from tests.launch import mpirun

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from tests.finite_strain.scenes import Rig

ROUNDOFF = 1e-12
SOFTER = 0.02
FORMS = {"displacement": 0.3, "mixed": 0.4999}


@pytest.fixture(autouse=True)
def iterative() -> Iterator[None]:
    """Solve all systems by multigrid, to a residual of 1e-8."""
    database, given = PETSc.Options("thirdbody_"), {"direct_up_to": "0", "ksp_rtol": "1e-8"}
    for name, value in given.items():
        database[name] = value
    yield
    for name in [*given, "mg_coarse_pc_type", "fieldsplit_displacement_mg_coarse_pc_type"]:
        database.delValue(name)


def touched_rig(form: str, order: int, fineness: float, folder: Path, numerics: Numerics = COARSER) -> Rig:
    """Return the undeformed pair with its balls pressed in: contact, constraints, and no Newton iteration.

    The penalty is softened so that the overlap presses about as the balls do in equilibrium.
    """
    plan = coarse_plan(in_form(form, pair(0.05, poisson=FORMS[form])), numerics=numerics)
    rig = coarse_rig(plan, folder, Discretisation(order, fineness))
    contact = rig.model.contact
    contact.set_approaches(np.full(len(contact.balls), 0.05))
    contact.set_penalties(SOFTER * penalties(rig.plan.problem, contact.balls, contact.approaches))
    rig.model.tangent()
    return rig


def solve(rig: Rig) -> tuple[int, float]:
    """Solve for the displacement by a unit approach; return iterations and true relative residual."""
    model, ksp = rig.model, rig.solver.linear.ksp
    b, x, residual = (model.matrix.createVecRight() for _ in range(3))
    model.border(np.ones(len(model.contact.balls)), b)
    ksp.setOperators(model.matrix)
    with rig.solver.options():
        ksp.solve(b, x)
    model.matrix.mult(x, residual)
    residual.axpy(-1.0, b)
    assert ksp.getConvergedReason() > 0
    return ksp.getIterationNumber(), residual.norm() / b.norm()


@pytest.mark.parametrize(("order", "low"), [(2, 1), (3, 2), (4, 2)])
def test_a_displacement_of_low_order_is_interpolated_exactly_where_it_is_free(
    order: int, low: int, tmp_path: Path
) -> None:
    rig = coarse_rig(coarse_plan(pair(0.05, poisson=0.3)), tmp_path, Discretisation(order, 1.0))
    model, coarse = rig.model, compat.function_space(rig.model.mesh, low, (3,))
    level = of_order(model.space, compat.function_space(model.mesh, low))
    matrix, held = interpolation(level, model.constrained, len(model.constrained), model.comm)
    x, y = matrix.createVecs()
    x.array[:] = np.random.default_rng(1).standard_normal(x.getLocalSize())
    matrix.mult(x, y)
    field, expected = dolfinx.fem.Function(coarse), dolfinx.fem.Function(model.space)
    field.x.array[:] = np.where(held.ravel(), 0.0, x.array_r)
    expected.interpolate(field)
    free = ~model.constrained.ravel()
    assert np.abs(y.array_r - expected.x.array)[free].max() < ROUNDOFF
    assert np.abs(expected.x.array[~free]).max() < ROUNDOFF  # so constrained values stay zero
    assert 0 < held.sum() < model.constrained.sum()


@pytest.mark.parametrize(("order", "share"), [(1, 1 / 6), (2, 1 / 2)])
def test_a_level_across_the_layer_holds_its_order_and_every_cubic_of_the_depth(
    order: int, share: float, tmp_path: Path
) -> None:
    space = coarse_rig(coarse_plan(pair(0.05, poisson=0.3)), tmp_path, Discretisation(3, 1.0)).model.space
    (level,) = upright(space, (order,))
    low = of_order(space, compat.function_space(space.mesh, order)).shapes
    z = space.tabulate_dof_coordinates()[:, 2:]
    held = np.hstack([z**0, z, z**2, z**3, low @ np.random.default_rng(1).standard_normal((low.shape[1], 2))])
    normal = sparse.linalg.splu((level.shapes.T @ level.shapes).tocsc())
    fit = normal.solve(level.shapes.T @ held)
    assert np.abs(level.shapes @ fit - held).max() < 100 * ROUNDOFF
    assert level.shapes.shape[1] < share * len(z)
    assert level.numbers.tolist() == list(range(level.owned))


@pytest.mark.parametrize(("order", "along"), [(2, (1,)), (3, (2, 1)), (4, (2, 1))])
def test_each_height_of_the_nodes_has_coarse_nodes_of_its_own(order: int, along: tuple[int, ...]) -> None:
    mesh = dolfinx.mesh.create_box(MPI.COMM_SELF, [[0, 0, -1], [1, 1, 0]], [2, 2, 2], dolfinx.mesh.CellType.hexahedron)
    levels = upright(compat.function_space(mesh, order, (3,)), along)
    assert [level.owned for level in levels] == [(2 * low + 1) ** 2 * (2 * order + 1) for low in along]


def test_the_lowest_level_is_interpolated_by_way_of_the_one_above_it(tmp_path: Path) -> None:
    space = coarse_rig(coarse_plan(pair(0.05, poisson=0.3)), tmp_path, Discretisation(3, 1.0)).model.space
    (direct,) = upright(space, (1,))
    middle, lowest = upright(space, (2, 1))
    assert abs(middle.shapes @ lowest.shapes - direct.shapes).max() < ROUNDOFF


@pytest.mark.parametrize(
    ("kind", "lean", "held"), [("hexahedron", 0.0, True), ("hexahedron", 0.1, False), ("tetrahedron", 0.0, False)]
)
def test_only_upright_hexahedra_have_the_level_across_the_layer(kind: str, lean: float, held: bool) -> None:
    cells = getattr(dolfinx.mesh.CellType, kind)
    mesh = dolfinx.mesh.create_box(MPI.COMM_SELF, [[0, 0, -1], [1, 1, 0]], [2, 2, 2], cells)
    mesh.geometry.x[:, 0] += lean * mesh.geometry.x[:, 2]
    assert bool(upright(compat.function_space(mesh, 2, (3,)), (1,))) == held


SHARED = """
import dolfinx, numpy as np
from mpi4py import MPI
from finite_strain import compat
from finite_strain.equilibrium.order_levels import interpolation, upright
comm = MPI.COMM_WORLD
mesh = dolfinx.mesh.create_box(comm, [[0, 0, -1], [1, 1, 0]], [3, 3, 4], dolfinx.mesh.CellType.hexahedron)
space = compat.function_space(mesh, 3, (3,))
points, owned = space.tabulate_dof_coordinates(), space.dofmap.index_map.size_local
(direct,), levels = upright(space, (1,)), upright(space, (2, 1))
place = np.asarray(direct.shapes.argmax(axis=0)).ravel()[: direct.owned]
fixed, own, matrices = np.zeros((len(points), 3), dtype=bool), owned, []
for level in levels:
    matrix, fixed = interpolation(level, fixed, own, comm)
    matrices.append(matrix)
    own = level.owned
field = lambda at: np.stack([at[:, 2] ** 3, at[:, 0] * at[:, 1], at[:, 0] * at[:, 2] ** 2], axis=1).ravel()
x, y = matrices[0].matMult(matrices[1]).createVecs()
x.array[:] = field(points[place])
matrices[0].matMult(matrices[1]).mult(x, y)
error = comm.allreduce(np.abs(y.array_r - field(points[:owned])).max(), op=MPI.MAX)
sizes = []
for level in levels:
    sizes += [comm.allreduce(level.owned), len(comm.allreduce(set(level.numbers.tolist()), op=MPI.BOR))]
if comm.rank == 0:
    print(error < 1e-12, *sizes)
"""


@pytest.mark.mpi
def test_ranks_share_the_nodes_of_the_levels_across_the_layer() -> None:
    done = mpirun(2, "-c", SHARED, timeout=120.0)
    # 7 x 7 nodes of order 2 and 4 x 4 vertices from above, 4 cells of order 3 across
    assert done.stdout.split() == ["True", "637", "637", "208", "208"], done.stderr


def test_constrained_components_keep_rows_of_their_own_at_every_order(tmp_path: Path) -> None:
    rig = touched_rig("displacement", 3, 1.0, tmp_path)
    operator, fine, fixed = rig.model.matrix, rig.model.space, rig.model.constrained
    for low in (2, 1):
        coarse = compat.function_space(rig.model.mesh, low)
        matrix, held = interpolation(of_order(fine, coarse), fixed, len(fixed), rig.model.comm)
        operator = operator.ptap(matrix)
        rows = np.flatnonzero(held.ravel()).astype(PETSc.IntType)
        values = operator[rows, :].copy()
        own = values[np.arange(len(rows)), rows].copy()
        assert own.min() > 0.5
        values[np.arange(len(rows)), rows] = 0.0
        assert np.abs(values).max() < ROUNDOFF
        assert np.linalg.norm(operator.getDiagonal().array_r, -np.inf) > 0.0
        fine, fixed = coarse, held


MOST = {"displacement": 16, "mixed": 25}
"""Iterations; 13 and 20 are taken at order 3."""


@pytest.mark.parametrize("form", FORMS)
def test_iterations_are_few_at_order_3(form: str, tmp_path: Path) -> None:
    iterations, residual = solve(touched_rig(form, 3, 1.0, tmp_path))
    assert residual < 2e-8
    assert iterations <= MOST[form]


@pytest.mark.parametrize(("form", "numerics"), [("displacement", DEFAULT), ("mixed", COARSER)], ids=FORMS)
def test_iterations_grow_little_with_the_mesh_at_order_2(form: str, numerics: Numerics, tmp_path: Path) -> None:
    taken = []
    for fineness in (1.0, 1.5):
        (tmp_path / str(fineness)).mkdir()
        rig = touched_rig(form, 2, fineness, tmp_path / str(fineness), numerics)
        iterations, residual = solve(rig)
        assert residual < 2e-8
        taken.append((rig.model.unknowns, iterations))
        rig.run.close()
    (few, coarse), (many, fine) = taken
    assert many > 2 * few
    assert fine <= MOST[form]
    assert fine <= 1.3 * coarse


def test_algebraic_multigrid_on_the_lowest_order_hardly_takes_more_iterations_than_factors(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(linear_solver, "along", lambda unknowns, order, mixed: ())
    taken = []
    for kind in ("cholesky", "gamg"):
        PETSc.Options("thirdbody_")["mg_coarse_pc_type"] = kind
        (tmp_path / kind).mkdir()
        rig = touched_rig("displacement", 3, 1.0, tmp_path / kind)
        taken.append(solve(rig)[0])
        assert rig.solver.linear.ksp.getPC().getMGCoarseSolve().getPC().getType() == kind
        rig.run.close()
    assert taken[1] <= 2 * taken[0]


def test_the_lowest_order_is_solved_by_factors_only_within_their_range() -> None:
    assert choose(5e6, False, {}).options["mg_coarse_pc_type"] == "cholesky"
    assert choose(6e6, False, {}).options["mg_coarse_pc_type"] == "gamg"
    assert choose(6e6, True, {}, order=4).options["fieldsplit_displacement_mg_coarse_pc_type"] == "cholesky"


def test_factors_that_do_not_fit_into_the_memory_are_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    rig = coarse_rig(coarse_plan(pair(0.05, poisson=0.3)), tmp_path)
    enough = factor_bytes(rig.model.unknowns) / linear_solver.SHARE

    def machine(memory: float) -> Any:
        monkeypatch.setattr(linear_solver, "free_memory", lambda: memory)

    machine(1.01 * enough)
    rig.solver.linear.factors().destroy()
    machine(0.99 * enough)
    with pytest.raises(NotConverged, match=r"factors of [\d ]+ unknowns need about .* take more machines"):
        rig.solver.linear.factors()
