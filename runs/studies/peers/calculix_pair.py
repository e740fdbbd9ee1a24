"""The pair in CalculiX (http://www.calculix.de): quadratic hexahedra, and face-to-face contact with a meshed sphere."""

import itertools
import subprocess
import tempfile
from collections.abc import Callable, Iterable
from pathlib import Path

import numpy as np

from runs.studies.peers.scene import LAME, SHEAR, STIFF, THICKNESS, Array, lines, report, weight_slope

CORNERS = [(0, 0), (2, 0), (2, 2), (0, 2)]
MIDDLES = [(1, 0), (2, 1), (1, 2), (0, 1)]
LEVELS = ((CORNERS, 0), (CORNERS, 2), (MIDDLES, 0), (MIDDLES, 2), (CORNERS, 1))
PLACES = np.array([(*flat, level) for flats, level in LEVELS for flat in flats])
"""Nodes of CalculiX's 20-node hexahedron, in halves of its edges."""
FACETS, ANGLE = 16, 0.95
"""Half the number of elements of the sphere along x, and the largest meshed angle [rad] from its axis."""
BULK = LAME + 2 / 3 * SHEAR
"""Bulk modulus of CalculiX's law mu/2 (J^(-2/3) I1 - 3) + K/2 (J - 1)^2, equal to the study's law at small strain."""


def mesh(axes: Iterable[Array], first: int) -> tuple[dict[int, tuple[float, ...]], list[list[int]]]:
    """Return node coordinates by number, counted from ``first``, and elements of a grid with planes ``axes``."""
    fine = [np.interp(np.arange(2 * len(a) - 1) / 2, range(len(a)), a) for a in axes]
    number: dict[tuple[int, ...], int] = {}
    elements = [
        [number.setdefault(tuple(2 * np.array(corner) + place), first + len(number)) for place in PLACES]
        for corner in itertools.product(*(range(len(a) // 2) for a in fine))
    ]
    return {n: tuple(float(a[i]) for a, i in zip(fine, at, strict=True)) for at, n in number.items()}, elements


def deck(approach: float, kind: str, layer: tuple, ball: tuple, fixed: dict[str, list[int]]) -> str:
    """Return the CalculiX input file."""

    def rows(numbers: Iterable[Iterable[object]]) -> str:
        return "\n".join(", ".join(map(str, row)) for row in numbers)

    def elements(found: list[list[int]], first: int) -> str:
        numbered = ([first + i, *nodes] for i, nodes in enumerate(found))
        return rows(part for e in numbered for part in ([*e[:11], ""], e[11:]))

    nodes = rows([n, *x] for n, x in (layer[0] | ball[0]).items())
    sets = "\n".join(f"*NSET, NSET={name}\n{rows([n] for n in found)}" for name, found in fixed.items())
    top = [1 + i for i, e in enumerate(layer[1]) if abs(layer[0][e[4]][2]) < 1e-9]
    return Path(__file__).with_name("pair.inp").read_text(encoding="utf-8").format(
        nodes=nodes, kind=kind, layer=elements(layer[1], 1), ball=elements(ball[1], 1 + len(layer[1])), sets=sets,
        top=rows([n, "S2"] for n in top), shear=SHEAR / 2, compressibility=2 / BULK, stiffness=STIFF, approach=approach,
    )  # fmt: skip


def integrals(nodes: Array, u: Array, slope: Callable[[Array], Array], count: int) -> tuple[float, float]:
    """Return half a ball's Q and T, with ``count``^3 points per element; ``nodes`` and ``u`` are (elements, 20, 3)."""
    points, weights = np.polynomial.legendre.leggauss(count)
    sides = nodes[:, 6] - nodes[:, 0]
    normal = tangential = 0.0

    def shapes(at: Array) -> Array:
        c = PLACES - 1
        factors = np.prod(np.where(c == 0, 1 - at**2, 1 + at * c), axis=1)
        return np.where(np.all(c != 0, axis=1), factors * (at @ c.T - 2) / 8, factors / 4)

    for index in itertools.product(range(count), repeat=3):
        at = points[list(index)]
        # complex-step derivatives are exact
        gradient = np.stack([shapes(at + 1e-30j * np.eye(3)[k]).imag / 1e-30 for k in range(3)], axis=1)
        H = np.einsum("eai,aj->eij", u, gradient) * 2 / sides[:, None, :]
        F = H + np.eye(3)
        J = np.linalg.det(F)
        inverse = np.linalg.inv(F).transpose(0, 2, 1)
        I1, isochoric = np.sum(F**2, axis=(1, 2)), SHEAR * J ** (-2 / 3)
        P = isochoric[:, None, None] * F + (BULK * (J - 1) * J - isochoric * I1 / 3)[:, None, None] * inverse
        psi = (isochoric * I1 - 3 * SHEAR) / 2 + BULK / 2 * (J - 1) ** 2
        volume = np.prod(weights[list(index)]) * np.prod(sides, axis=1) / 8
        x = nodes[:, 0, 0] + (1 + at[0]) / 2 * sides[:, 0]
        normal -= float(np.sum(P[:, 2, 2] * volume) / THICKNESS)
        tangential -= float(np.sum((psi - np.sum(H[:, :, 0] * P[:, :, 0], axis=1)) * slope(x) * volume))
    return normal, tangential


def main(approach: float, size: str) -> None:
    """Solve with the element type and grid fineness n of ``size``, such as "C3D20Rxn", and print the answer."""
    kind, fineness = size.split("x")
    grid = lines(approach, int(fineness))
    layer = mesh(grid, 1)
    angles = np.linspace(-ANGLE, ANGLE, 2 * FACETS + 1)
    flat, elements = mesh((angles, angles[FACETS:], np.array([1.0, 0.8])), 1 + len(layer[0]))
    directions = {n: np.array([np.tan(a), np.tan(b), -1.0]) for n, (a, b, _) in flat.items()}
    ball = {n: tuple(np.array([1, 0, 1]) + flat[n][2] * d / np.linalg.norm(d)) for n, d in directions.items()}
    ends = [g[[0, -1]] for g in grid]
    fixed = {"BASE": [n for n, x in layer[0].items() if x[2] == -THICKNESS], "PRESSED": list(ball)}
    fixed |= {f"SIDES_{'XY'[k]}": [n for n, x in layer[0].items() if x[k] in ends[k]] for k in (0, 1)}
    with tempfile.TemporaryDirectory() as name:
        text = deck(approach, kind, layer, (ball, elements), fixed)
        Path(name, "pair.inp").write_text(text, encoding="utf-8")
        subprocess.run(["ccx", "pair"], cwd=name, check=True, stdout=subprocess.DEVNULL)
        table = [line.split() for line in Path(name, "pair.dat").read_text(encoding="utf-8").splitlines()]
    numbers = [row for row in table if len(row) == 4 and row[0].isdigit()]
    u = {int(row[0]): [float(v) for v in row[1:]] for row in numbers}
    Q, T = integrals(
        np.array([[layer[0][n] for n in e] for e in layer[1]]),
        np.array([[u[n] for n in e] for e in layer[1]]),
        lambda x: weight_slope(x, approach),
        2 if kind.endswith("R") else 3,
    )
    version = subprocess.run(["ccx", "-v"], check=False, stdout=subprocess.PIPE, text=True).stdout.split()[-1]
    report("CalculiX", version, approach, f"{kind}, grid {fineness}", 3 * len(layer[0]), 2 * Q, 2 * T)
