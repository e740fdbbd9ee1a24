"""Transfer of states between meshes and ranks: exact for polynomials that the elements contain."""

from __future__ import annotations

import json
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("dolfinx")

from dolfinx.fem import Function
from dolfinx.mesh import CellType, create_box
from mpi4py import MPI

from finite_strain import compat
from finite_strain.contact.contact_energy import Penalised
from finite_strain.discretisation import point_location
from finite_strain.discretisation.checkpoint import Snapshot
from finite_strain.discretisation.nodal_values import element_of
from finite_strain.discretisation.point_location import Locations
from finite_strain.discretisation.unknowns import Fields
from finite_strain.one_discretisation import mesh_box
from finite_strain.planning.records import Discretisation
from finite_strain.planning.run_plan import plan_run
from linear_bem import FiniteStrain
from linear_bem.errors import OutputUnusable
from tests.finite_strain.scenes import CUBIC, coarse_plan, pair
from tests.launch import mpirun

ROUNDOFF = 1e-10
"""Absolute, for polynomials of degree zero to two at points that Newton's method locates in skew cells."""
APPROACHES = np.array([0.1, 0.07])
PENALTIES = np.array([3.0, 4.0])


def fields_on(mesh: Any, order: int) -> Fields:
    """Return a displacement of an order and a pressure of the order below."""
    spaces = compat.function_space(mesh, order, (3,)), compat.function_space(mesh, order - 1)
    displacement, pressure = (Function(space) for space in spaces)
    return Fields(displacement, [pressure])


def held(order: int) -> int:
    """Return the degree of the polynomials that cells of an order contain if their sides are quadratic curves."""
    return order // 2


def polynomial(points: np.ndarray, order: int) -> np.ndarray:
    """Return a polynomial (n, 3) that cells of an order (two and up) contain."""
    x, y, z = points.T
    d = held(order)
    return np.column_stack([x * y ** (d - 1) - z, (0.3 * x + y - 0.2 * z) ** d, z**d - 2.0 * x * z ** (d - 1)])


def pressure(points: np.ndarray, order: int) -> np.ndarray:
    """Return a polynomial (n,) that cells of an order contain."""
    return np.asarray((points @ [0.3, 1.0, -0.2]) ** held(order))


def fill(fields: Fields, order: int) -> None:
    nodal, pressures = fields.points
    fields.displacement.x.array[:] = polynomial(nodal, order).ravel()
    fields.pressures[0].x.array[:] = pressure(pressures, order - 1)


def taken(fraction: float, fields: Fields) -> Snapshot:
    """Return a snapshot of the fields whose multipliers come from twice their displacement (collective)."""
    source = Penalised(2.0 * fields.copy()[0], 0.9 * APPROACHES, PENALTIES, 1.0)
    return Snapshot.take(fraction, fields, APPROACHES, source)


def mismatch(fields: Fields, snapshot: Snapshot, order: int) -> float:
    """Return the largest difference between a snapshot and the polynomial at the fields' nodes."""
    (nodal, pressures), source = snapshot.at(fields)
    first, second = fields.points
    assert np.array_equal(source.approaches, 0.9 * APPROACHES)
    assert np.array_equal(source.penalties, PENALTIES)
    return max(
        float(np.abs(nodal - polynomial(first, order)).max()),
        float(np.abs(source.displacement - 2.0 * polynomial(first, order)).max()) / 2.0,
        float(np.abs(pressures - pressure(second, order - 1)).max()),
    )


def meshes(folder: Path, comm: MPI.Comm) -> list[Any]:
    """Return two meshes of one box, the second finer."""
    plan = coarse_plan(pair(0.1, poisson=0.3))
    return [
        mesh_box(plan.box(Discretisation(2, fineness)), folder / f"mesh_{fineness}.msh", comm)[0]
        for fineness in (1.0, 2.0)
    ]


@pytest.fixture(scope="module")
def two(tmp_path_factory: pytest.TempPathFactory) -> list[Any]:
    return meshes(tmp_path_factory.mktemp("meshes"), MPI.COMM_SELF)


@pytest.mark.parametrize(("before", "after"), [(2, 2), (2, 4), (4, 2), (4, 4)])
@pytest.mark.parametrize("way", [(0, 1), (1, 0)], ids=["to a finer mesh", "to a coarser one"])
def test_polynomials_of_the_order_are_transferred_exactly(
    two: list[Any], before: int, after: int, way: tuple[int, int]
) -> None:
    order = min(before, after)
    source, target = fields_on(two[way[0]], before), fields_on(two[way[1]], after)
    fill(source, order)
    snapshot = taken(0.5, source)
    assert mismatch(target, snapshot, order) < ROUNDOFF


def test_a_saved_state_is_restored_bit_for_bit(two: list[Any], tmp_path: Path) -> None:
    fields = fields_on(two[0], 3)
    random = np.random.default_rng(1)
    for function in fields.functions:
        function.x.array[:] = random.normal(size=function.x.array.shape)
    kept, path = taken(0.25, fields), tmp_path / "state.npz"
    kept.save(path)
    assert [file.name for file in tmp_path.iterdir()] == ["state.npz"]
    back = Snapshot.load(path)
    assert back.fraction == 0.25
    assert np.array_equal(back.approaches, APPROACHES)
    assert np.array_equal(back.nodes, kept.nodes)
    assert all(np.array_equal(a, b) for a, b in zip(back.values, kept.values, strict=True))
    # on its own mesh it is unchanged, to roundoff of the node positions
    values, source = back.at(fields)
    for now, then in zip(values, fields.copy(), strict=True):
        assert np.abs(now - then).max() < ROUNDOFF
    assert np.abs(source.displacement - 2.0 * fields.copy()[0]).max() < 2.0 * ROUNDOFF


def test_a_file_that_holds_no_state_is_refused_by_its_name(tmp_path: Path) -> None:
    truncated, foreign = tmp_path / "truncated.npz", tmp_path / "foreign.npz"
    truncated.write_bytes(b"PK truncated")
    np.savez(foreign, something=np.zeros(3))
    for path in (truncated, foreign, tmp_path / "missing.npz"):
        with pytest.raises(
            OutputUnusable, match=rf"{path.name} cannot be read .*: remove it to start from the beginning"
        ):
            Snapshot.load(path)


def test_a_wider_domain_takes_the_states_of_the_outline(two: list[Any], tmp_path: Path) -> None:
    source = fields_on(two[0], 2)
    source.displacement.interpolate(lambda x: np.stack([x[0], 2.0 * x[1], x[2]]))
    low, high = (getattr(np, name)(two[0].geometry.x, axis=0) for name in ("min", "max"))
    wider = mesh_box(
        coarse_plan(pair(0.1, distance=4.0, poisson=0.3)).box(Discretisation(2, 1.0)), tmp_path / "m.msh", MPI.COMM_SELF
    )[0]
    target = fields_on(wider, 2)
    assert np.any(target.points[0] > high + 0.1)
    x = np.clip(target.points[0], low, high)
    nodal = taken(1.0, source).at(target)[0][0]
    assert np.abs(nodal - x * (1.0, 2.0, 1.0)).max() < ROUNDOFF


def test_a_point_between_the_cells_of_a_mesh_is_refused(two: list[Any]) -> None:
    nodes = taken(1.0, fields_on(two[0], 2)).nodes
    kept = nodes[[int(nodes[:, :, 0].mean(axis=1).argmin()), int(nodes[:, :, 0].mean(axis=1).argmax())]]
    with pytest.raises(OutputUnusable, match="belongs to another scene"):
        Locations().find(kept, nodes.mean(axis=1))


def test_points_are_searched_once_in_a_mesh(two: list[Any], monkeypatch: pytest.MonkeyPatch) -> None:
    coarse, fine = (fields_on(mesh, 3) for mesh in two)
    searched, search = [], point_location._located
    monkeypatch.setattr(point_location, "_located", lambda *given: searched.append(given) or search(*given))
    locations = Locations()

    def searches(snapshot: Snapshot, fields: Fields) -> int:
        searched.clear()
        found, known = snapshot.at(fields, locations), snapshot.at(fields)
        assert all(np.array_equal(one, other) for one, other in zip(found[0], known[0], strict=True))
        return len(searched) - len(fields.points)

    for fields in (coarse, fine):
        fill(fields, 3)
    assert searches(taken(0.5, coarse), fine) == 2  # nodes of the displacement, and of the pressure
    assert searches(taken(0.7, coarse), fine) == 0
    assert searches(taken(0.5, coarse), fields_on(two[1], 2)) == 1  # its displacement has the pressure's nodes
    assert searches(taken(0.5, coarse), fine) == 0
    assert searches(taken(0.5, fine), coarse) == 2  # another mesh
    assert searches(taken(0.5, coarse), fine) == 2


@pytest.fixture(scope="module")
def on_two(two: list[Any], tmp_path_factory: pytest.TempPathFactory) -> tuple[Any, Path]:
    """What `main` said on two ranks, and its folder."""
    folder, fields = tmp_path_factory.mktemp("ranks"), fields_on(two[0], 3)
    fill(fields, 3)
    taken(0.5, fields).save(folder / "one.npz")
    done = mpirun(2, "-m", "tests.finite_strain.test_transfer", folder)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout), folder


@pytest.mark.mpi
def test_states_are_transferred_between_one_and_two_ranks(two: list[Any], on_two: tuple[Any, Path]) -> None:
    said, folder = on_two
    assert len(said["mismatches"]) == 2
    assert max(said["mismatches"]) < ROUNDOFF
    assert mismatch(fields_on(two[1], 3), Snapshot.load(folder / "two.npz"), 3) < ROUNDOFF


@pytest.mark.mpi
def test_a_rank_without_cells_has_an_empty_table_of_their_nodes(on_two: tuple[Any, Path]) -> None:
    assert on_two[0]["tables"] == [[0, 8], [1, 8]]


def main() -> None:
    """On two ranks: load the state of one, save a state of two, and print the mismatch of each rank.

    And the shape of each rank's table of the nodes of one cell.
    """
    folder, comm = Path(sys.argv[1]), MPI.COMM_WORLD
    cell = create_box(comm, [[0.0] * 3, [1.0] * 3], [1, 1, 1], CellType.hexahedron)
    tables = comm.gather(compat.geometry_dofs(cell).shape, root=0)
    coarse, fine = (fields_on(mesh, 3) for mesh in meshes(folder, comm))
    found = comm.gather(mismatch(fine, Snapshot.load(folder / "one.npz"), 3), root=0)
    fill(coarse, 3)
    state = taken(0.5, coarse)
    if tables is not None:
        state.save(folder / "two.npz")
        print(json.dumps({"mismatches": found, "tables": sorted(tables)}))


if __name__ == "__main__":
    main()


def test_a_point_next_to_a_curved_cell_is_not_taken_to_lie_in_it(tmp_path: Path) -> None:
    """Newton's method for its reference coordinates does not converge there, and may stop inside the cell."""
    problem = replace(pair(0.3, distance=2.4, thickness=0.6, poisson=0.49), finite_strain=FiniteStrain())
    box = plan_run(problem, 0.02, "finite_strain", None, (1 / 15, 1.0)).box(CUBIC)
    mesh = mesh_box(box, tmp_path / "mesh.msh", MPI.COMM_SELF)[0]
    nodes = mesh.geometry.x[compat.geometry_dofs(mesh)]
    fields = fields_on(mesh, 4)
    points = fields.points[0]
    cells, places = Locations().find(nodes, points)
    shapes = element_of(nodes.shape[1]).tabulate(0, places)[0].reshape(len(places), -1)
    assert np.abs(np.einsum("na,nai->ni", shapes, nodes[cells]) - points).max() < ROUNDOFF
