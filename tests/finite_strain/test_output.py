"""What is written on disk: exact under a uniform strain, complementary in contact, the same on any number of ranks."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("dolfinx")

import h5py
from mpi4py import MPI

from finite_strain import compat
from finite_strain.discretisation.nodal_values import CellNodes
from finite_strain.output.field_catalogue import CATALOGUE, FieldChoice
from finite_strain.output.field_writer import FieldWriter
from finite_strain.output.step_files import INDEX, move_steps, write_step_and_index
from finite_strain.output.top_surface import TopSurface
from finite_strain.planning.records import Discretisation
from linear_bem import Elastic, Ellipsoid, Problem
from linear_bem.errors import InvalidProblem
from tests.finite_strain.scenes import Rig, balls_at, coarse_plan, coarse_rig, on_layer, pair, relatively, single
from tests.launch import mpirun

ROUNDOFF = 1e-11
COARSE, FINER = Discretisation(order=2, fineness=1.0), Discretisation(order=3, fineness=1.0)
STRETCH = 0.8
NU = 0.3
LAME, SHEAR = NU / ((1.0 + NU) * (1.0 - 2.0 * NU)), 0.5 / (1.0 + NU)


def coarse(problem: Problem, folder: Path, model: str = "finite_strain", level: Discretisation = COARSE) -> Rig:
    return coarse_rig(coarse_plan(problem, model), folder, level)


def written(rig: Rig, folder: Path, choice: FieldChoice | None = None) -> h5py.File:
    FieldWriter(rig.model, folder, choice).write(1, 1.0)
    return h5py.File(folder / "step_0001.h5", "r")


def compress(rig: Rig, stretch: float) -> None:
    """Press the whole layer down between smooth walls: every strain is the same everywhere."""
    nodes = rig.model.space.tabulate_dof_coordinates()
    rig.model.nodal[:, 2] = (stretch - 1.0) * (nodes[:, 2] - nodes[:, 2].min())


@pytest.fixture(scope="module")
def confined(tmp_path_factory: pytest.TempPathFactory) -> Any:
    folder = tmp_path_factory.mktemp("confined")
    rig = coarse(single(0.1, poisson=NU), folder)
    compress(rig, STRETCH)
    return written(rig, folder)


def test_confined_compression_is_written_exactly(confined: Any) -> None:
    fields, J = confined["node_fields"], STRETCH
    # Cauchy stress of mu/2 (I1 - 3) - mu ln J + lambda/2 (J - 1)^2 at the stretches (1, 1, J)
    axial = SHEAR * (J - 1.0 / J) + LAME * (J - 1.0)
    lateral = LAME * (J - 1.0)
    np.testing.assert_allclose(fields["volume_ratio"][:], J, rtol=ROUNDOFF)
    np.testing.assert_allclose(fields["principal_stretches"][:], np.tile([1.0, 1.0, J], (len(fields["gap"]), 1)),
                               rtol=ROUNDOFF)  # fmt: skip
    stress = np.diag([lateral, lateral, axial])
    np.testing.assert_allclose(fields["cauchy_stress"][:] - stress, 0.0, atol=ROUNDOFF)
    np.testing.assert_allclose(fields["von_mises"][:], abs(axial - lateral), rtol=ROUNDOFF)
    np.testing.assert_allclose(fields["pressure"][:], -(axial + 2.0 * lateral) / 3.0, rtol=ROUNDOFF)


def test_small_strain_writes_hookes_stress_and_linear_measures(tmp_path: Path) -> None:
    rig = coarse(single(0.1, poisson=NU, shape="paraboloid"), tmp_path, "small_strain")
    compress(rig, STRETCH)
    rig.model.contact.set_approaches(np.array([0.1]))
    with written(rig, tmp_path) as file:
        fields, strain = file["node_fields"], STRETCH - 1.0
        np.testing.assert_allclose(fields["volume_ratio"][:], 1.0 + strain, rtol=ROUNDOFF)
        np.testing.assert_allclose(fields["von_mises"][:], 2.0 * SHEAR * abs(strain), rtol=ROUNDOFF)
        np.testing.assert_allclose(fields["pressure"][:], -(LAME + 2.0 / 3.0 * SHEAR) * strain, rtol=ROUNDOFF)
        np.testing.assert_allclose(fields["principal_stretches"][:, 2], STRETCH, rtol=ROUNDOFF)
        x, y, z = file["points"][:].T + fields["displacement"][:].T
        np.testing.assert_allclose(fields["gap"][:], 0.5 * (x**2 + y**2) - 0.1 - z, atol=ROUNDOFF)


SHAPES: dict[str, tuple[int, ...]] = {"Scalar": (), "Vector": (3,), "Tensor": (3, 3)}
"""Components of XDMF's attribute types."""


def test_every_field_names_its_unit_and_meaning(confined: Any) -> None:
    assert set(confined["node_fields"]) == set(CATALOGUE)
    for name, field in CATALOGUE.items():
        data = confined[f"node_fields/{name}"]
        assert data.shape == (len(confined["points"]), *SHAPES[field.kind])
        assert data.attrs["unit"] == field.unit
        assert data.attrs["meaning"] == field.meaning
    assert confined["points"].attrs["unit"] == "m"


def volumes(points: np.ndarray, cells: np.ndarray) -> np.ndarray:
    """Return the volumes of straight-sided columns between flat ends, by their corners in VTK's order."""
    a, b, c, d = (points[cells[:, k]] for k in range(4))
    area = 0.5 * ((c - a)[:, 0] * (d - b)[:, 1] - (c - a)[:, 1] * (d - b)[:, 0])
    return area * (points[cells[:, 4:]] - points[cells[:, :4]])[..., 2].mean(axis=1)


def test_cells_are_hexahedra_in_the_order_of_vtk_that_fill_the_layer(confined: Any) -> None:
    points, cells = confined["points"][:], confined["cells"][:]
    found = volumes(points, cells)
    assert found.min() > 0.0
    assert found.sum() == relatively(np.prod(np.ptp(points, axis=0)), 1e-9)
    assert len(cells) % confined["cells"].attrs["order"] ** 3 == 0
    assert sorted(np.unique(cells)) == list(range(len(points)))


@pytest.mark.parametrize("order", [2, 3, 4])
def test_gradients_at_the_nodes_of_skew_cells_are_exact_and_averages_keep_them(order: int) -> None:
    from dolfinx.mesh import CellType, create_box  # noqa: PLC0415

    mesh = create_box(MPI.COMM_SELF, [np.zeros(3), np.array([2.0, 1.0, 1.0])], [3, 2, 2], CellType.hexahedron)
    mesh.geometry.x[:, 0] += 0.2 * mesh.geometry.x[:, 1] * mesh.geometry.x[:, 0]
    nodes = CellNodes(compat.function_space(mesh, order, (3,)))
    x = nodes.space.tabulate_dof_coordinates()
    slope = np.array([[0.1, 0.2, 0.0], [0.0, -0.3, 0.1], [0.2, 0.0, 0.1]])
    gradient = nodes.gradient(x @ slope.T)
    np.testing.assert_allclose(gradient, np.broadcast_to(slope, gradient.shape), atol=ROUNDOFF)
    values = nodes.averaged([(np.arange(12, dtype=np.int32), gradient.reshape(12, -1, 9))])
    np.testing.assert_allclose(values, np.broadcast_to(slope.ravel(), values.shape), atol=ROUNDOFF)
    lattice = nodes.lattice
    assert volumes(lattice.points, lattice.cells) == pytest.approx(
        np.prod(np.ptp(lattice.points[lattice.cells], axis=1), axis=1)
    )
    a, b, c, d = np.moveaxis(lattice.points[lattice.pieces], 2, 0)
    areas = 0.5 * np.cross(c - a, d - b)
    assert np.linalg.norm(areas, axis=2).sum(axis=1) == pytest.approx(1.0)
    assert np.linalg.norm(areas.sum(axis=1), axis=1) == pytest.approx(1.0)


def test_the_layers_value_is_written_at_the_interface(tmp_path: Path) -> None:
    problem = on_layer(balls_at((0.0, 0.0)), single(0.1).load, 1.0, Elastic(10.0, NU), poisson=NU)
    rig = coarse(problem, tmp_path)
    compress(rig, STRETCH)
    with written(rig, tmp_path) as file:
        z, region = file["points"][:, 2], file["cell_fields/region"][:]
        in_layer = np.unique(file["cells"][:][region == 1])
        von_mises = file["node_fields/von_mises"][:]
        assert set(region) == {1, 2}
        assert np.ptp(von_mises[in_layer]) < ROUNDOFF
        assert np.abs(z[in_layer] + 1.0).min() < 1e-9  # the interface is among them
        beyond = np.setdiff1d(np.arange(len(z)), in_layer)
        np.testing.assert_allclose(von_mises[beyond], 10.0 * von_mises[in_layer[0]], rtol=1e-9)


@pytest.fixture(scope="module")
def pressed(tmp_path_factory: pytest.TempPathFactory) -> tuple[Rig, Path]:
    """A pair on a line that is turned by 30 degrees, in equilibrium."""
    folder = tmp_path_factory.mktemp("pressed")
    rig = coarse(pair(0.1, angle=math.pi / 6.0), folder, level=FINER)
    *_, last = rig.press()
    assert rig.path.augment(last)
    written(rig, folder).close()
    return rig, folder


def test_written_contact_is_complementary(pressed: tuple[Rig, Path]) -> None:
    _, folder = pressed
    with h5py.File(folder / "step_0001.h5") as file:
        points = file["points"][:]
        gap, pressure = file["node_fields/gap"][:], file["node_fields/contact_pressure"][:]
    top = np.abs(points[:, 2]) < 1e-9
    assert pressure.min() >= 0.0
    assert pressure[~top].max() == 0.0
    peak = pressure.max()
    # discretisation: between the quadrature points that carry the contact, nodes may lie inside the ball
    assert gap[top].min() > -1e-3
    clear = top & (gap > 1e-3)
    assert clear.sum() > 20
    assert pressure[clear].max() < 0.02 * peak
    touched = top & (pressure > 0.5 * peak)
    assert touched.any()
    assert np.abs(gap[touched]).max() < 1e-3


def test_the_written_gap_of_a_long_body_is_that_of_its_contact(tmp_path: Path) -> None:
    long = Ellipsoid((1.5, 0.7, 1.0))  # its axes are the scene's, those of the model are turned
    rig = coarse(pair(0.1, shape=long, distance=2.6, angle=math.pi / 4.0), tmp_path)
    rig.press()
    with written(rig, tmp_path, FieldChoice(("gap", "contact_pressure"))) as file:
        gap, pressure = file["node_fields/gap"][:], file["node_fields/contact_pressure"][:]
    touched = pressure > 0.5 * pressure.max()
    assert touched.any()
    assert np.abs(gap[touched]).max() < 0.01


def test_the_surface_carries_the_force_on_the_balls(pressed: tuple[Rig, Path]) -> None:
    rig, _ = pressed
    surface = TopSurface(rig.model).gathered()
    assert surface is not None
    a, b, c = surface.points[surface.triangles, :2].transpose(1, 0, 2)
    shadow = 0.5 * ((b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0])  # positive where normals point up
    force = np.sum(shadow * surface.pressure[surface.triangles].mean(axis=1))
    # pressure linear between nodes; two balls, of which the model holds a quarter
    assert force == relatively(2.0 * rig.model.forces()[0, 2], 0.03)


def test_everything_is_written_in_the_scenes_own_frame(pressed: tuple[Rig, Path]) -> None:
    _, folder = pressed
    with h5py.File(folder / "step_0001.h5") as file:
        points, u = file["points"][:], file["node_fields/displacement"][:]
        stress = file["node_fields/cauchy_stress"][:]
        axes, mirrors = file.attrs["ball_positions"][:], file.attrs["mirror_planes"][:]
    right = np.array([math.cos(math.pi / 6.0), math.sin(math.pi / 6.0)])
    np.testing.assert_allclose(sorted(axes.tolist()), sorted([(-right).tolist(), right.tolist()]), atol=1e-12)
    assert len(mirrors) == 2
    assert np.abs(np.abs(mirrors @ [*right, 0.0]) - [1.0, 0.0]).max() < 1e-12
    deepest = points[np.argmin(u[:, 2])]
    assert np.linalg.norm(axes - deepest[:2], axis=1).min() < 0.05
    # on the plane between the balls nothing moves through it, and no shear acts
    middle = np.abs(points[:, :2] @ right) < 1e-9
    assert np.abs(u[middle, :2] @ right).max() < 1e-12
    across = np.array([-right[1], right[0]])
    shear = np.einsum("i,nij,j->n", right, stress[middle][:, :2, :2], across)
    assert np.abs(shear).max() < 0.05 * np.abs(stress[middle]).max()  # discretisation


def test_fields_not_requested_are_neither_compiled_nor_written(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def never(*_: Any) -> None:
        raise AssertionError("compiled an expression")

    rig = coarse(single(0.1, poisson=NU), tmp_path)
    monkeypatch.setattr(compat, "compile_expression", never)
    with written(rig, tmp_path, FieldChoice(("displacement", "gap"))) as file:
        assert set(file["node_fields"]) == {"displacement", "gap"}
    FieldWriter(rig.model, tmp_path, FieldChoice(())).write(2, 1.0)
    assert not (tmp_path / "step_0002.h5").exists()
    with pytest.raises(AssertionError, match="compiled"):
        FieldWriter(rig.model, tmp_path, FieldChoice(("von_mises",)))


class Vtx:
    """Stands for DOLFINx's writer, which Debian 12's lacks: keeps the values of its functions."""

    def __init__(self, comm: Any, name: str, functions: list[Any]) -> None:
        self.folder, self.functions = Path(name), functions

    def __enter__(self) -> Vtx:
        self.folder.mkdir()
        return self

    def write(self, time: float) -> None:
        found = {}
        for function in self.functions:
            places = function.function_space.tabulate_dof_coordinates()
            found[function.name] = np.column_stack([places, function.x.array.reshape(len(places), -1)])
        np.savez(self.folder / "read.npz", time=time, **found)

    def __exit__(self, *_: object) -> None:
        pass


def test_where_adios2_is_there_a_step_is_written_as_vtx_too(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    turned = pair(0.1, angle=0.6, poisson=NU)
    rig = coarse(turned, tmp_path)
    compress(rig, STRETCH)
    before = rig.model.mesh.geometry.x.copy()
    monkeypatch.setattr(compat, "vtx_writer", lambda: None)
    written(rig, tmp_path).close()
    assert not list(tmp_path.glob("*.bp"))
    monkeypatch.setattr(compat, "vtx_writer", lambda: Vtx)
    written(rig, tmp_path).close()  # and the folder of the step is replaced the second time
    with written(rig, tmp_path) as file, np.load(tmp_path / "step_0001.bp" / "read.npz") as vtx:
        assert vtx["time"] == 1.0
        for name, data in file["node_fields"].items():
            ours = np.column_stack([file["points"], np.reshape(data, (len(data), -1))])
            theirs, sizes = vtx[name], np.abs(ours).max(axis=0) + 1e-12
            order = [np.lexsort(np.round(rows[:, :3], 6).T) for rows in (ours, theirs)]
            np.testing.assert_allclose((theirs[order[1]] - ours[order[0]]) / sizes, 0.0, atol=ROUNDOFF)
    assert np.array_equal(rig.model.mesh.geometry.x, before)
    FieldWriter(rig.model, tmp_path).forget_after(0)
    assert not list(tmp_path.glob("step_*"))


@pytest.mark.skipif(compat.vtx_writer() is None, reason="DOLFINx was built without ADIOS2")
def test_dolfinx_itself_writes_vtx(tmp_path: Path) -> None:
    rig = coarse(single(0.1, poisson=NU), tmp_path, level=FINER)
    compress(rig, STRETCH)
    nodes = rig.model.space.dofmap.index_map.size_global
    written(rig, tmp_path).close()
    size = sum(file.stat().st_size for file in (tmp_path / "step_0001.bp").iterdir())
    assert size > 8 * nodes * sum(math.prod(SHAPES[field.kind]) for field in CATALOGUE.values())


def test_every_nth_step_and_the_last_are_written() -> None:
    choice = FieldChoice(every=3)
    assert [n for n in range(1, 8) if choice.wants(n, n / 7.0)] == [3, 6, 7]
    with pytest.raises(InvalidProblem, match="unknown mises"):
        FieldChoice(("mises",), every=0)


def test_the_index_has_the_steps_of_both_folders_after_a_move(tmp_path: Path) -> None:
    finer = tmp_path / "finer"
    finer.mkdir()
    for folder, number in ((tmp_path, 1), (tmp_path, 2), (finer, 2), (finer, 3)):
        with h5py.File(folder / f"step_{number:04d}.h5", "w") as file:
            file["points"], file["cells"] = np.zeros((8, 3)), np.arange(8)[None]
            for group in ("node_fields", "cell_fields"):
                file.create_group(group)
        write_step_and_index(folder, number)
    move_steps(finer, tmp_path)
    index = (tmp_path / INDEX).read_text(encoding="utf-8")
    assert [f"step_{number:04d}.h5:/points" in index for number in range(1, 5)] == [True, True, True, False]


@pytest.mark.mpi
def test_an_unwritable_folder_stops_every_rank(tmp_path: Path) -> None:
    code = (
        "import sys; from pathlib import Path; import numpy as np; from mpi4py import MPI\n"
        "from finite_strain.output.step_files import write_gathered\n"
        "from linear_bem.errors import OutputUnusable\n"
        "comm, said = MPI.COMM_WORLD, ''\n"
        "try:\n"
        "    write_gathered(comm, Path(sys.argv[1]), {'x': np.zeros(3)}, lambda file: None)\n"
        "except OutputUnusable as error:\n"
        "    said = str(error)\n"
        "said = comm.gather(said)\n"
        "print(*said or [], sep='\\n', end='')\n"
    )
    done = mpirun(2, "-c", code, tmp_path / "missing" / "a.h5")
    assert done.returncode == 0, done.stderr
    assert len(done.stdout.splitlines()) == 2
    assert done.stdout.count("a.h5 cannot be written") == 2
