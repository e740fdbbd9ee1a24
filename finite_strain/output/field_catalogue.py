"""The fields that a run can write: names, units, meanings, and the choice among them (without DOLFINx)."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from numbers import Integral

import numpy as np

from finite_strain.geometry.estimates import body_of, section_edge
from finite_strain.geometry.symmetry import ModelBall
from linear_bem.errors import InvalidProblem
from linear_bem.indenter import TINY


@dataclass(frozen=True)
class Field:
    """A field on the nodes: its unit, its XDMF attribute type, and its meaning."""

    unit: str
    kind: str
    meaning: str


_RECOVERED = "at a node the mean over its cells, weighted by volume; where layer and substrate meet, the layer's"
CATALOGUE = {
    "displacement": Field("m", "Vector", "displacement of the material point, as solved for"),
    "cauchy_stress": Field("Pa", "Tensor", f"Cauchy stress, z upwards, tension > 0; {_RECOVERED}"),
    "von_mises": Field("Pa", "Scalar", "von Mises' equivalent stress of the written Cauchy stress"),
    "pressure": Field("Pa", "Scalar", "mean pressure, -1/3 of the written Cauchy stress's trace; compression > 0"),
    "volume_ratio": Field(
        "1", "Scalar", f"J, deformed over undeformed volume (at small strain 1 + trace of the strain); {_RECOVERED}"
    ),
    "principal_stretches": Field(
        "1", "Vector", f"principal stretches, largest first (at small strain 1 + principal strains); {_RECOVERED}"
    ),
    "contact_pressure": Field(
        "Pa", "Scalar",
        "contact pressure per deformed area; at nodes of the top the mean over the node's test function (nodal force "
        "over nodal area; on tetrahedra of a vertex's hat function), zero below; not corrected by small strain",
    ),
    "gap": Field(
        "m", "Scalar",
        "distance of the displaced node from the nearest ball: along the normal for a sphere, vertical for a "
        "paraboloid and at small strain; on the top the contact gap, negative where the node penetrates; "
        "infinite where no body has a height",
    ),
}  # fmt: skip
"""Every field by its name."""


@dataclass(frozen=True)
class FieldChoice:
    """The fields to write (``names``), and the load steps: every ``every``-th, and always the last."""

    names: tuple[str, ...] = tuple(CATALOGUE)
    every: int = 1

    def __post_init__(self) -> None:
        faults = choice_faults(self.names, self.every)
        if faults:
            raise InvalidProblem(*faults)

    def wants(self, number: int, fraction: float) -> bool:
        """Return whether step ``number`` (1, 2, ...) at a fraction of the full load is written."""
        return bool(self.names) and (number % self.every == 0 or fraction >= 1.0 - 1e-12)


def choice_faults(names: Sequence[str], every: int) -> list[str]:
    """Return a message per fault of a choice of fields."""
    if not (isinstance(names, tuple | list) and all(isinstance(name, str) for name in names)):
        given, example = (f'"{names}"',) * 2 if isinstance(names, str) else (repr(names), '"gap"')
        return [f"output.fields: must be a list of names, such as ({example},), got {given}"]
    faults = []
    unknown = [name for name in names if name not in CATALOGUE]
    if unknown:
        faults.append(f"output.fields: unknown {', '.join(unknown)}; known: {', '.join(CATALOGUE)}")
    if not isinstance(every, Integral) or every < 1:
        faults.append(f"output.every: must be 1 or more and whole (write every so many load steps), got {every!r}")
    return faults


def outline(ball: ModelBall) -> np.ndarray:
    """Return points (directions, radii, 3) [m] of a body from its apex, in the scene's axes; nan for a named shape.

    A body without an edge ends at the height of the lowest point at its reach, one with an edge where it has no height.
    """
    angles = np.linspace(0.0, 2.0 * np.pi, 97)[:, None] + np.pi / 96.0  # none along x: a picture is cut there
    shares = np.sin(0.5 * np.pi * np.linspace(0.0, 1.0, 41))
    if isinstance(ball.shape, str):
        return np.full((len(angles), len(shares), 3), np.nan)
    body, ways = body_of(ball), np.exp(1j * angles)
    reach = (1.0 - TINY) * ball.reach
    with np.errstate(all="ignore"):  # an oval body with an edge has no height at its reach
        level = float(np.min(body.height(reach * ways.real, reach * ways.imag)))
    widths = [body.half_width(way.real, way.imag) for way in ways[:, 0]]
    edge = [
        [section_edge(body, math.inf if width else level, way, width or ball.reach)]
        for way, width in zip(ways[:, 0], widths, strict=True)
    ]
    points = (1.0 - TINY) * np.array(edge) * shares * ways
    x, y = points.real, points.imag
    return np.stack([x, y, np.broadcast_to(body.height(x, y), x.shape)], axis=2)
