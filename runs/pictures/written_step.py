"""One written load step of a run, completed by reflection at its mirror planes: the data of a picture."""

from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from linear_bem.arrays import Array
from linear_bem.errors import MissingDependency, OutputUnusable

_MIRRORED = {8: [4, 5, 6, 7, 0, 1, 2, 3], 4: [1, 0, 2, 3]}
"""Corners of a reflected hexahedron and tetrahedron in VTK's order (a reflection turns cells inside out)."""


@dataclass(frozen=True, eq=False)
class DrawnBall:
    """A ball in one step: axis (x, y), radius, approach, all in m, and shape.

    Shapes other than spheres and paraboloids have an ``outline``: points (directions, radii, 3) [m] from the apex.
    """

    position: tuple[float, float]
    radius: float
    approach: float
    shape: str
    outline: Array | None = field(default=None, compare=False)

    @property
    def extent(self) -> float:
        """The body's half width [m]."""
        return self.radius if self.outline is None else float(np.abs(self.outline[..., :2]).max())


@dataclass(frozen=True, eq=False)
class WrittenStep:
    """Points (n, 3) and displacement (n, 3) [m], cells (m, 8 or 4), regions of the cells (m,), node fields, balls.

    ``deformed``: whether contact was in the deformed configuration.
    """

    number: int
    points: Array
    displacement: Array
    cells: NDArray[np.int64]
    region: NDArray[np.int64]
    fields: dict[str, Array]
    units: dict[str, str]
    balls: tuple[DrawnBall, ...]
    young: float
    deformed: bool

    @property
    def dimensionless(self) -> bool:
        """Whether lengths are in units of ball 0's radius and stresses in units of the layer's modulus: both are 1."""
        return self.young == self.balls[0].radius == 1.0

    @property
    def of_layer(self) -> NDArray[np.int64]:
        """Numbers of the layer's points."""
        return np.unique(self.cells[self.region == 1])

    @property
    def thickness(self) -> float:
        """Thickness of the undeformed layer [m]."""
        return -float(self.points[self.of_layer, 2].min())


def step_files(run: Path) -> dict[int, Path]:
    """Return the HDF5 file of every written step, by number; ``run``: folder of the run or of its fields."""
    for folder in (run / "fields", run):
        found = {int(path.stem.removeprefix("step_")): path for path in sorted(folder.glob("step_*.h5"))}
        if found:
            return found
    if not run.is_dir():
        raise OutputUnusable(f"{run}: is no folder; name the output folder of a finite-element run")
    raise OutputUnusable(
        f"{run}: holds no written fields (fields/step_*.h5); wait for its first load step, or name the output "
        "folder of a finite-element run whose [output] has not switched them off"
    )


def read_step(path: Path, number: int, field: str | None = None) -> WrittenStep:
    """Return a written step of the whole scene with one node field, or with all; raises `OutputUnusable`."""
    try:
        import h5py  # noqa: PLC0415  (not needed where nothing is drawn)
    except ImportError as error:
        raise MissingDependency(f"written fields need h5py to be read: {error}; `thirdbody doctor`") from None
    try:
        with h5py.File(path, "r") as file:
            there = file["node_fields"]
            names = [name for name in there if name != "displacement"] if field is None else [field]
            for name in ("displacement", *names):
                if name not in there:
                    other = "every picture needs it: " if name == "displacement" else "name another --field, or "
                    raise OutputUnusable(
                        f"{path}: holds no field {name} (there are {', '.join(there)}); {other}add it to [output] "
                        "fields and run the scene again"
                    )
            columns = [file.attrs[f"ball_{name}"][:] for name in ("positions", "radii", "approaches", "shapes")]
            drawn = file["ball_outlines"][:] if "ball_outlines" in file else np.full((len(columns[0]), 1), np.nan)
            balls = zip(*columns, [o if np.isfinite(o).all() else None for o in drawn], strict=True)
            part = WrittenStep(
                number,
                file["points"][:],
                there["displacement"][:],
                file["cells"][:],
                file["cell_fields/region"][:],
                {name: there[name][:] for name in names},
                {name: str(there[name].attrs["unit"]) for name in ("displacement", *names)},
                tuple(DrawnBall((float(p[0]), float(p[1])), float(r), float(d), str(s), o) for p, r, d, s, o in balls),
                float(file.attrs["layer_young"]),
                bool(file.attrs["deformed"]),
            )
            return _completed(part, file.attrs["frame_origin"], file.attrs["mirror_planes"])
    except (OSError, KeyError, ValueError) as error:
        if isinstance(error, OutputUnusable):
            raise
        raise OutputUnusable(f"{path}: cannot be read ({error}); run the scene again with --fresh") from None


def _completed(part: WrittenStep, origin: Array, normals: Array) -> WrittenStep:
    """Return the whole scene: the part and its mirror images, with the nodes that they share."""
    points, displacement, cells, region = part.points, part.displacement, part.cells, part.region
    fields: dict[str, Array] = dict(part.fields)
    for normal in normals:
        count = len(points)
        mirror = np.eye(3) - 2.0 * np.outer(normal, normal)
        points = np.concatenate([points, (points - origin) @ mirror + origin])
        displacement = np.concatenate([displacement, displacement @ mirror])
        cells = np.concatenate([cells, cells[:, _MIRRORED[cells.shape[1]]] + count])
        region = np.concatenate([region, region])
        fields = {k: np.concatenate([v, mirror @ v @ mirror if v.ndim == 3 else v]) for k, v in fields.items()}
    size = float(np.ptp(points, axis=0).max())
    _, first, inverse = np.unique(np.round(points / (1e-9 * size)), axis=0, return_index=True, return_inverse=True)
    kept: dict[str, Any] = {name: values[first] for name, values in fields.items()}
    return replace(
        part, points=points[first], displacement=displacement[first], cells=inverse.reshape(-1)[cells], region=region,
        fields=kept,
    )  # fmt: skip
