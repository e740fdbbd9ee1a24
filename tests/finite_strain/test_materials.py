"""The strain energy against its textbook formula in 60 digits, its stress, and its small-strain limit."""

from __future__ import annotations

from collections.abc import Callable
from decimal import Decimal, getcontext
from itertools import pairwise

import numpy as np
import pytest

pytest.importorskip("dolfinx")

import dolfinx
import ufl
from mpi4py import MPI

from finite_strain import compat
from finite_strain.mechanics.materials import ENERGIES, cauchy_stress, energy_density
from finite_strain.mechanics.volumetric import Compressible
from linear_bem.law import LAWS, Law, NeoHookean
from tests.finite_strain.scenes import relatively

ROUNDOFF = 1e-13
"""Relative, after some hundred operations on numbers of similar size."""
SHEAR, LAME = 0.4, 3.1
getcontext().prec = 60

Density = Callable[[np.ndarray], float]


def test_every_law_has_an_energy() -> None:
    assert set(ENERGIES) == set(LAWS.values())


class OneTetrahedron:
    """Evaluates functions of a displacement gradient as the models do: through a compiled form."""

    def __init__(self, law: Law | None) -> None:
        mesh = dolfinx.mesh.create_unit_cube(MPI.COMM_SELF, 1, 1, 1)
        self.gradient = dolfinx.fem.Constant(mesh, np.zeros((3, 3)))
        self.direction = dolfinx.fem.Constant(mesh, np.zeros((3, 3)))
        shear, lame = (dolfinx.fem.Constant(mesh, value) for value in (SHEAR, LAME))
        variable = ufl.variable(self.gradient)
        psi = energy_density(law, variable, shear, Compressible(lame), self.gradient)
        stress = ufl.diff(psi, variable)
        cauchy = cauchy_stress(law, variable, stress)
        dx = ufl.Measure("dx", domain=mesh, metadata={"quadrature_degree": 0})
        self.forms = {
            name: compat.compile_form(value * dx, MPI.COMM_SELF)
            for name, value in (
                ("energy", psi),
                ("stress", ufl.inner(stress, self.direction)),
                ("cauchy", ufl.inner(cauchy, self.direction)),
            )
        }

    def energy(self, H: np.ndarray) -> float:
        return self._value("energy", H)

    def tensor(self, name: str, H: np.ndarray) -> np.ndarray:
        answer = np.empty((3, 3))
        for i, j in np.ndindex(3, 3):
            self.direction.value[:] = 0.0
            self.direction.value[i, j] = 1.0
            answer[i, j] = self._value(name, H)
        return answer

    def _value(self, name: str, H: np.ndarray) -> float:
        self.gradient.value[:] = H
        return float(dolfinx.fem.assemble_scalar(self.forms[name]))


@pytest.fixture(scope="module")
def finite() -> OneTetrahedron:
    return OneTetrahedron(NeoHookean())


@pytest.fixture(scope="module")
def small() -> OneTetrahedron:
    return OneTetrahedron(None)


def determinant(F: list[list[Decimal]]) -> Decimal:
    (a, b, c), (d, e, f), (g, h, i) = F
    return a * (e * i - f * h) - b * (d * i - f * g) + c * (d * h - e * g)


def textbook(H: np.ndarray) -> float:
    """Return mu/2 (I1 - 3) - mu ln J + lambda/2 (J - 1)^2 in 60 digits."""
    F = [[Decimal(float(H[i, j])) + (i == j) for j in range(3)] for i in range(3)]
    first = sum((entry * entry for row in F for entry in row), Decimal(0))
    J = determinant(F)
    return float(Decimal(SHEAR) / 2 * (first - 3) - Decimal(SHEAR) * J.ln() + Decimal(LAME) / 2 * (J - 1) ** 2)


def gradients(scale: float, count: int = 20) -> list[np.ndarray]:
    random = np.random.default_rng(3)
    return [scale * random.uniform(-1.0, 1.0, (3, 3)) for _ in range(count)]


@pytest.mark.parametrize("scale", [0.4, 0.1, 0.01, 1e-3, 1e-5, 1e-7, 1e-10])
def test_neo_hookean_energy_is_the_textbook_formula_to_roundoff(finite: OneTetrahedron, scale: float) -> None:
    for H in gradients(scale):
        assert finite.energy(H) == relatively(textbook(H), ROUNDOFF)


def test_the_textbook_formula_in_doubles_loses_its_digits_at_the_strains_of_a_stiff_substrate() -> None:
    (H,) = gradients(1e-7, 1)
    F = np.eye(3) + H
    J = np.linalg.det(F)
    plain = SHEAR / 2 * (np.sum(F * F) - 3.0) - SHEAR * np.log(J) + LAME / 2 * (J - 1.0) ** 2
    assert plain != relatively(textbook(H), 1e-6)


def test_the_series_and_the_logarithm_meet_without_a_step(finite: OneTetrahedron) -> None:
    for j in (0.02, -0.02):
        values = []
        for volume in (j * (1.0 - 1e-9), j * (1.0 + 1e-9)):
            H = np.eye(3) * ((1.0 + volume) ** (1.0 / 3.0) - 1.0)
            assert finite.energy(H) == relatively(textbook(H), ROUNDOFF)
            values.append(finite.energy(H))
        assert values[0] == relatively(values[1], 1e-8)


@pytest.mark.parametrize("law", ["finite", "small"])
def test_stress_is_the_derivative_of_the_energy(law: str, request: pytest.FixtureRequest) -> None:
    cell: OneTetrahedron = request.getfixturevalue(law)
    step = 1e-5
    for H in gradients(0.3, 4):
        stress = cell.tensor("stress", H)
        for i, j in np.ndindex(3, 3):
            unit = np.zeros((3, 3))
            unit[i, j] = step
            slope = (cell.energy(H + unit) - cell.energy(H - unit)) / (2.0 * step)
            # a central difference: its truncation is of the order of the step squared
            assert stress[i, j] == pytest.approx(slope, abs=1e-8)


def test_cauchy_stress_is_mu_over_j_times_b_minus_one_plus_the_volumetric_part(finite: OneTetrahedron) -> None:
    for H in gradients(0.3, 4):
        F = np.eye(3) + H
        J = np.linalg.det(F)
        expected = SHEAR / J * (F @ F.T - np.eye(3)) + LAME * (J - 1.0) * np.eye(3)
        assert finite.tensor("cauchy", H) == pytest.approx(expected, abs=ROUNDOFF * 10)


def test_a_rigid_rotation_has_no_energy(finite: OneTetrahedron) -> None:
    c, s = np.cos(0.7), np.sin(0.7)
    turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    assert finite.energy(turn - np.eye(3)) == pytest.approx(0.0, abs=1e-15)
    for H in gradients(0.2, 3):
        turned = turn @ (np.eye(3) + H) - np.eye(3)
        assert finite.energy(turned) == relatively(finite.energy(H), 1e-12)


def hooke(H: np.ndarray) -> float:
    strain = 0.5 * (H + H.T)
    return float(SHEAR * np.sum(strain * strain) + LAME / 2 * np.trace(strain) ** 2)


def test_small_strain_energy_is_hookes(small: OneTetrahedron) -> None:
    for H in gradients(0.3):
        assert small.energy(H) == relatively(hooke(H), ROUNDOFF)
        assert small.tensor("cauchy", H) == pytest.approx(small.tensor("stress", H), abs=0.0)


def test_neo_hookean_tends_to_hooke_in_proportion_to_the_strain(finite: OneTetrahedron) -> None:
    for H in gradients(1.0, 5):
        departures = [finite.energy(e * H) / hooke(e * H) - 1.0 for e in (1e-3, 1e-4)]
        assert abs(departures[1]) < 5e-3
        assert departures[0] / departures[1] == relatively(10.0, 0.1)


def test_an_inverted_element_has_no_energy(finite: OneTetrahedron) -> None:
    assert np.isnan(finite.energy(np.diag([0.0, 0.0, -1.5])))


def test_the_pressure_keeps_rising_in_strong_compression(finite: OneTetrahedron) -> None:
    squeezes = [0.5, 0.2, 0.1, 0.05]
    pressures = [-finite.tensor("stress", np.diag([0.0, 0.0, s - 1.0]))[2, 2] for s in squeezes]
    assert all(a < b for a, b in pairwise(pressures))
