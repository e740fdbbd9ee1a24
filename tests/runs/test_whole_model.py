"""The whole model for ParaView: mirrored as vectors and tensors are, without gaps, and readable by meshio."""

from __future__ import annotations

from pathlib import Path

import h5py
import numpy as np
import pytest

from runs.commands.render import render_run
from runs.pictures.written_step import step_files
from tests.runs.test_rendering import write_run

pytest.importorskip("mpi4py")


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The index of a run's whole model, with a tensor field whose components tell where they come from."""
    run = write_run(tmp_path_factory.mktemp("run"))
    for path in step_files(run).values():
        with h5py.File(path, "a") as file:
            x, y, z = file["points"][:].T
            stress = np.array([[x + 1.0, x * y, x * z], [x * y, y + 2.0, y * z], [x * z, y * z, z]]).transpose(2, 0, 1)
            file["node_fields/cauchy_stress"] = stress
            u = file["node_fields/displacement"][:]
            u[:, 0] = 0.1 * x
            file["node_fields/displacement"][...] = u
            file["node_fields/cauchy_stress"].attrs.update(unit="Pa", kind="Tensor")
    (index,) = render_run(run, whole=True)
    return index


def test_the_whole_is_four_times_the_quarter_and_without_gaps(whole: Path) -> None:
    assert sorted(path.name for path in whole.parent.glob("step_*.h5")) == ["step_0001.h5", "step_0002.h5"]
    with h5py.File(whole.parent / "step_0002.h5") as file, h5py.File(whole.parent.parent / "step_0002.h5") as part:
        points, cells = file["points"][:], file["cells"][:]
        assert len(cells) == 4 * len(part["cells"])
        assert len(points) == 25 * 21 * 5  # of 13, 11 and 5 nodes: those on the mirror planes are shared
        corners = points[cells]
        edges = corners[:, [1, 3, 4]] - corners[:, :1]
        volumes = np.linalg.det(edges)
        assert np.all(volumes > 0.0)  # no cell is inside out
        assert volumes.sum() == pytest.approx(np.prod(np.ptp(points, axis=0)))


def test_vectors_and_tensors_are_mirrored_as_such(whole: Path) -> None:
    with h5py.File(whole.parent / "step_0002.h5") as file:
        x, y, z = file["points"][:].T
        stress, u = file["node_fields/cauchy_stress"][:], file["node_fields/displacement"][:]
    a, b = np.abs(x), np.abs(y)
    # xx, yy and zz are even, xy is odd in both, xz in x alone, yz in y alone
    assert stress[:, 0, 0] == pytest.approx(a + 1.0)
    assert stress[:, 1, 1] == pytest.approx(b + 2.0)
    assert stress[:, 0, 1] == pytest.approx(a * b * np.sign(x) * np.sign(y))
    assert stress[:, 0, 2] == pytest.approx(a * z * np.sign(x))
    assert stress[:, 1, 2] == pytest.approx(b * z * np.sign(y))
    assert u[:, 0] == pytest.approx(0.1 * x)
    assert np.abs(u[:, 2]).max() == pytest.approx(0.4e-3, rel=0.05)


def test_meshio_reads_every_step(whole: Path) -> None:
    meshio = pytest.importorskip("meshio")
    with meshio.xdmf.TimeSeriesReader(whole) as reader:
        points, cells = reader.read_points_cells()
        assert reader.num_steps == 2
        _, fields, _ = reader.read_data(1)
    assert len(points) == 25 * 21 * 5
    assert [block.type for block in cells] == ["hexahedron"]
    assert {"displacement", "von_mises", "cauchy_stress"} <= set(fields)
