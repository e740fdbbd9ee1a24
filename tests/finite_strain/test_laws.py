"""Every law against its paper's closed forms, its small-strain limit, and exact tangents where stretches coincide."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("dolfinx")

import dolfinx
import ufl
from mpi4py import MPI

from finite_strain import compat
from finite_strain.discretisation.regions import constant, with_constants
from finite_strain.mechanics.materials import energy_density
from finite_strain.mechanics.volumetric import Compressible, Mixed, volume_stiffness
from linear_bem import FiniteStrain, Gent, Hyperfoam, Layer, MooneyRivlin, NeoHookean, Ogden, Yeoh
from linear_bem.law import LAWS, Law
from tests.finite_strain.scenes import coarse_plan, coarse_rig, relatively, single

LAYER = Layer(1.0, 0.3, 1.0)
MU, LAMBDA = LAYER.shear_modulus, LAYER.lame_first
GIVEN: dict[str, Law] = {
    "neo_hookean": NeoHookean(), "mooney_rivlin": MooneyRivlin(0.3), "yeoh": Yeoh((-0.02, 0.001)), "gent": Gent(20.0),
    "ogden": Ogden((1.3, -2.0), (0.7, 0.3)), "hyperfoam": Hyperfoam((8.0, -2.0), (0.7, 0.3)),
}  # fmt: skip
Stretches = np.ndarray


def parts(x: Stretches) -> tuple[complex, complex, complex]:
    """Return A = I1 - 3 - 2 ln J, B = I2 - 3 - 4 ln J and J of stretches (3,), as the textbooks write them."""
    J = x[0] * x[1] * x[2]
    return sum(x**2) - 3 - 2 * np.log(J), sum((J / x) ** 2) - 3 - 4 * np.log(J), J


def textbook(name: str, x: Stretches) -> complex:
    """Return the strain energy as its paper has it; complex stretches give its exact derivatives."""
    A, B, J = parts(x)
    U = LAMBDA / 2 * (J - 1) ** 2
    match GIVEN[name]:
        case MooneyRivlin(s):
            return MU / 2 * ((1 - s) * A + s * B) - s * MU * (J - 1) ** 2 + U
        case Yeoh((c, d)):
            return MU / 2 * (A + c * A**2 + d * A**3) + U
        case Gent(limit):
            return -MU / 2 * limit * np.log(1 - A / limit) + U
        case Ogden(a, w):
            return sum(2 * MU * y / n**2 * (sum(x**n) - 3 - n * np.log(J)) for n, y in zip(a, w, strict=True)) + U
        case Hyperfoam(a, w):
            b = LAMBDA / (2 * MU)
            return sum(2 * MU * y / n**2 * (sum(x**n) - 3 + (J ** (-n * b) - 1) / b) for n, y in zip(a, w, strict=True))
    return MU / 2 * A + U


class Point:
    """Energy, stress and tangent of a law in one cell with a uniform displacement gradient, as the models have them."""

    def __init__(self, law: Law, mixed: bool = False, lame: float = LAMBDA) -> None:
        mesh = dolfinx.mesh.create_unit_cube(MPI.COMM_SELF, 1, 1, 1, dolfinx.mesh.CellType.hexahedron)
        space = compat.function_space(mesh, 1, (3,))
        self._nodes = space.tabulate_dof_coordinates()
        self.u, self.one, self.other = (dolfinx.fem.Function(space) for _ in range(3))
        still = dolfinx.fem.Function(space, self.u.x)
        self.p, self.lame = dolfinx.fem.Constant(mesh, 0.0), lame
        volumetric: Any = Compressible(constant(mesh, lame))
        if mixed:
            volumetric = Mixed(self.p, constant(mesh, 1.0 / lame), constant(mesh, volume_stiffness(MU, lame)))
        moving = ufl.variable(ufl.grad(self.u))
        psi = energy_density(with_constants(law, mesh), moving, constant(mesh, MU), volumetric, ufl.grad(still))
        energy = psi * ufl.Measure("dx", domain=mesh, metadata={"quadrature_degree": 0})
        slope = ufl.derivative(energy, self.u, self.one)
        self._forms = {"energy": energy, "stress": slope, "tangent": ufl.derivative(slope, self.u, self.other)}
        self._compiled: dict[str, Any] = {}

    def _value(self, name: str) -> float:
        if name not in self._compiled:
            self._compiled[name] = compat.compile_form(self._forms[name], MPI.COMM_SELF)
        return float(dolfinx.fem.assemble_scalar(self._compiled[name]))

    def _set(self, field: Any, gradient: np.ndarray) -> None:
        field.x.array[:] = (self._nodes @ gradient.T).ravel()

    def _each(self, name: str, field: Any) -> np.ndarray:
        """Return the values of a form for each component of a direction."""
        answer = np.zeros((3, 3))
        for i, j in np.ndindex(3, 3):
            self._set(field, np.outer(np.eye(3)[i], np.eye(3)[j]))
            answer[i, j] = self._value(name)
        return answer

    def at(self, H: np.ndarray) -> None:
        self._set(self.u, H)
        self.p.value = self.lame * (np.linalg.det(np.eye(3) + H) - 1.0) if np.isfinite(self.lame) else 0.3

    def energy(self, H: np.ndarray) -> float:
        self.at(H)
        return self._value("energy")

    def stress(self, H: np.ndarray) -> np.ndarray:
        self.at(H)
        return self._each("stress", self.one)

    def tangent(self, H: np.ndarray) -> np.ndarray:
        self.at(H)
        answer = np.zeros((3, 3, 3, 3))
        for k, m in np.ndindex(3, 3):
            self._set(self.other, np.outer(np.eye(3)[k], np.eye(3)[m]))
            answer[:, :, k, m] = self._each("tangent", self.one)
        return answer


@pytest.fixture(scope="module", params=list(GIVEN))
def name(request: pytest.FixtureRequest) -> str:
    return str(request.param)


@pytest.fixture(scope="module")
def point(name: str) -> Point:
    return Point(GIVEN[name])


def turns(count: int = 3) -> list[np.ndarray]:
    random = np.random.default_rng(5)
    return [np.linalg.qr(random.normal(size=(3, 3)))[0] for _ in range(count)]


STATES = [np.array(s) for s in ((1.3, 0.9, 0.8), (0.55, 1.2, 1.1), (1.01, 0.98, 1.0), (1.4, 1.4, 0.6), (0.9, 0.9, 0.9))]


def test_all_laws_are_tested() -> None:
    assert set(GIVEN) == set(LAWS)


def test_energy_and_stress_are_the_papers(name: str, point: Point) -> None:
    for stretches, turn in zip(STATES, turns(len(STATES)), strict=True):
        H = turn.T @ np.diag(stretches - 1.0) @ turn
        assert point.energy(H) == relatively(textbook(name, stretches), 1e-10)  # the textbook's own cancellation
        complex_step = 1e-30
        stress = [textbook(name, stretches + 1j * complex_step * unit).imag / complex_step for unit in np.eye(3)]
        assert point.stress(H) == pytest.approx(turn.T @ np.diag(stress) @ turn, abs=1e-12)


def test_stress_and_tangent_are_the_derivatives_of_the_energy(point: Point) -> None:
    random, step = np.random.default_rng(1), 1e-5
    H, way = 0.2 * random.uniform(-1.0, 1.0, (3, 3)), random.uniform(-1.0, 1.0, (3, 3))
    slope = (point.energy(H + step * way) - point.energy(H - step * way)) / (2.0 * step)
    assert np.sum(point.stress(H) * way) == pytest.approx(slope, abs=1e-8)  # truncation: the step squared
    bend = (point.stress(H + step * way) - point.stress(H - step * way)) / (2.0 * step)
    assert np.einsum("ijkl,kl", point.tangent(H), way) == pytest.approx(bend, abs=1e-7)


def test_small_strains_are_hookes(point: Point) -> None:
    random = np.random.default_rng(2)
    for _ in range(3):
        H = random.uniform(-1.0, 1.0, (3, 3))
        strain = 0.5 * (H + H.T)
        hooke = MU * np.sum(strain * strain) + LAMBDA / 2 * np.trace(strain) ** 2
        departures = [point.energy(e * H) / (e * e * hooke) - 1.0 for e in (1e-4, 1e-5)]
        # theory: the next term of the energy is cubic; roundoff would show as 1e-6 if numbers near 1 were subtracted
        assert abs(departures[1]) < 3e-4
        assert departures[0] / departures[1] == relatively(10.0, 0.1)


def test_turns_cost_nothing_and_inverted_elements_have_no_energy(point: Point) -> None:
    (turn,) = turns(1)
    turn = turn * np.linalg.det(turn)
    assert point.energy(turn - np.eye(3)) == pytest.approx(0.0, abs=1e-14)
    assert point.stress(np.zeros((3, 3))) == pytest.approx(0.0, abs=1e-15)
    assert np.isnan(point.energy(np.diag([0.0, 0.1, -1.5])))


UNIAXIAL = {
    "neo_hookean": lambda x: MU * (x**2 - 1 / x),
    "mooney_rivlin": lambda x: MU * (0.7 + 0.3 / x) * (x**2 - 1 / x),
    "yeoh": lambda x: MU * (x**2 - 1 / x) * (1 - 0.04 * (x**2 + 2 / x - 3) + 0.003 * (x**2 + 2 / x - 3) ** 2),
    "gent": lambda x: MU * (x**2 - 1 / x) * 20 / (20 - (x**2 + 2 / x - 3)),
    "ogden": lambda x: sum(2 * MU * w / a * (x**a - x ** (-a / 2)) for a, w in ((1.3, 0.7), (-2.0, 0.3))),
}
BIAXIAL = {
    "neo_hookean": lambda x: MU * (x**2 - x**-4),
    "mooney_rivlin": lambda x: MU * (0.7 + 0.3 * x**2) * (x**2 - x**-4),
    "yeoh": lambda x: MU * (x**2 - x**-4) * (1 - 0.04 * (2 * x**2 + x**-4 - 3) + 0.003 * (2 * x**2 + x**-4 - 3) ** 2),
    "gent": lambda x: MU * (x**2 - x**-4) * 20 / (20 - (2 * x**2 + x**-4 - 3)),
    "ogden": lambda x: sum(2 * MU * w / a * (x**a - x ** (-2 * a)) for a, w in ((1.3, 0.7), (-2.0, 0.3))),
}
"""Cauchy stress of an incompressible sheet or rod with free sides, as the papers print it."""


@pytest.mark.parametrize("form", ["displacement", "mixed"])
@pytest.mark.parametrize("law", list(UNIAXIAL))
def test_incompressible_rods_and_sheets_are_the_papers(law: str, form: str) -> None:
    cell = Point(GIVEN[law], mixed=form == "mixed", lame=np.inf if form == "mixed" else LAMBDA)
    for stretch in (0.6, 0.9, 1.0 + 1e-6, 1.2, 1.8):
        for closed, sides in ((UNIAXIAL[law], (1.0, -0.5, -0.5)), (BIAXIAL[law], (1.0, 1.0, -2.0))):
            stretches = stretch ** np.array(sides)
            cauchy = cell.stress(np.diag(stretches - 1.0)).diagonal() * stretches
            # the pressure, of whatever size, is what makes the free sides free
            assert cauchy[0] - cauchy[2] == pytest.approx(closed(stretch), rel=1e-8, abs=1e-14)


@pytest.mark.parametrize("law", [law for law in GIVEN if GIVEN[law].takes_pressure])
def test_the_mixed_form_has_the_stress_of_the_other(law: str) -> None:
    mixed, plain = Point(GIVEN[law], mixed=True), Point(GIVEN[law])
    H = turns(1)[0].T @ np.diag([0.3, -0.1, -0.25]) @ turns(1)[0]
    assert mixed.stress(H) == pytest.approx(plain.stress(H), abs=1e-14)


@pytest.mark.parametrize(("sides", "across"), [((1, 0, 0), 0.3), ((1, 1, 0), 0.6 / 0.7)])
def test_a_foam_narrows_by_poissons_ratio_at_any_stretch(sides: tuple[int, ...], across: float) -> None:
    cell, law = Point(GIVEN["hyperfoam"]), GIVEN["hyperfoam"]
    assert isinstance(law, Hyperfoam)
    for stretch in (0.3, 0.7, 1.5):
        stretches = np.where(sides, stretch, stretch**-across)
        J, b = float(np.prod(stretches)), 0.3 / 0.4
        terms = zip(law.exponents, law.weights, strict=True)
        nominal = sum(2 * MU * w / a * (stretch**a - J ** (-a * b)) / stretch for a, w in terms)
        # Storakers: stretch^a = J^(-a b) along free directions
        stress = cell.stress(np.diag(stretches - 1.0)).diagonal()
        assert stress == pytest.approx(np.where(sides, nominal, 0.0), rel=1e-8, abs=1e-8 * abs(nominal))


@pytest.mark.parametrize(
    "law", [MooneyRivlin(0.0), Yeoh((0.0, 0.0)), Gent(1e12), Ogden((2.0, 2.0), (0.7, 0.3))], ids=lambda law: law.name
)
def test_laws_without_their_own_numbers_are_neo_hookean(law: Law) -> None:
    cell, plain = Point(law), Point(NeoHookean())
    for stretches in STATES:
        H = turns(1)[0].T @ np.diag(stretches - 1.0) @ turns(1)[0]
        assert cell.stress(H) == pytest.approx(plain.stress(H), abs=1e-11)
        assert cell.tangent(H) == pytest.approx(plain.tangent(H), abs=1e-11)


def exact_tangent(exponent: float, near: tuple[float, ...]) -> np.ndarray:
    """Return dP/dF of a sum of 2 mu / a^2 (l^a - 1 - a ln l) at F = diag(near)."""
    x, shear = np.array(near, dtype=np.longdouble), 2.0 * MU / exponent
    slope = shear * (x ** (exponent - 1) - 1 / x)
    answer = np.zeros((3, 3, 3, 3))
    for i, j in np.ndindex(3, 3):
        middle = 0.5 * (x[i] + x[j])
        minus = shear * ((exponent - 1) * middle ** (exponent - 2) + 1 / middle**2)
        if abs(x[i] - x[j]) > 1e-7:  # below it the quotient is the derivative between the two
            minus = (slope[i] - slope[j]) / (x[i] - x[j])
        plus = (slope[i] + slope[j]) / (x[i] + x[j])
        if i == j:
            answer[i, i, i, i] = minus
        else:
            answer[i, j, i, j], answer[i, j, j, i] = 0.5 * (minus + plus), 0.5 * (minus - plus)
    return answer


def test_a_run_feels_its_law(tmp_path: Path) -> None:
    def force(law: Law) -> float:
        problem = replace(single(0.3, poisson=0.3), finite_strain=FiniteStrain(law))
        rig = coarse_rig(coarse_plan(problem), tmp_path)
        rig.press()
        return float(rig.normal_forces()[0])

    plain = force(NeoHookean())
    assert force(Yeoh((0.3, 0.04))) > 1.01 * plain
    assert force(Yeoh((-0.3, 0.04))) < 0.99 * plain


@pytest.mark.parametrize("exponent", [-2.0, 0.5, 8.0])
def test_tangents_are_exact_where_stretches_coincide(exponent: float) -> None:
    cell = Point(Ogden((exponent, exponent), (0.7, 0.3)), lame=0.0)
    for apart in (1e-3, 1e-6, 1e-9, 0.0):
        for near in ((1.5, 1.5 + apart, 0.6), (0.5, 0.5 + apart, 1.3), (1.2, 1.2 + apart, 1.2 + 2.7 * apart)):
            exact = exact_tangent(exponent, near)
            for turn in (np.eye(3), *turns(1)):
                turned = np.einsum("ai,bj,ck,dl,abcd->ijkl", turn, turn, turn, turn, exact)
                H = turn.T @ np.diag(np.array(near) - 1.0) @ turn
                # roundoff; eigenvalues differentiated as they stand miss two thirds of the tangent
                assert np.abs(cell.tangent(H) - turned).max() < 5e-13 * np.abs(exact).max()


@pytest.mark.parametrize(
    ("law", "poisson", "words"),
    [
        (MooneyRivlin(1.2), 0.4, "share: must lie between 0 and 1, got 1.2"),
        (Yeoh((-0.1, 0.001)), 0.4, "ratios: must give an energy that grows"),
        (Yeoh((0.1,)), 0.4, "ratios: must be two numbers"),
        (Gent(-3.0), 0.4, "limit: must be greater than 0, got -3"),
        (Gent(float("nan")), 0.4, "limit: must be a finite number"),
        (Gent((30.0,)), 0.4, "limit: must be a finite number, got (30.0,)"),
        (MooneyRivlin((0.2, 0.3)), 0.4, "share: must be a finite number"),
        (Yeoh(0.1), 0.4, "ratios: must be a tuple of finite numbers, got 0.1"),
        (Ogden((2.0, 0.0), (0.5, 0.5)), 0.4, "exponents: must not be zero"),
        (Ogden((2.0,), (0.5, 0.5)), 0.4, "weights: needs one for each exponent, got 2 for 1"),
        (Ogden((2.0, 3.0), (0.5, 0.4)), 0.4, "weights: must be greater than 0 and add up to 1"),
        (Ogden(2.0, (1.0,)), 0.4, "exponents: must be a tuple of finite numbers, got 2.0"),
        (Hyperfoam((8.0,), (1.0,)), 0.46, 'law: hyperfoam takes layer.poisson up to 0.45, got 0.46; use "ogden"'),
    ],
)
def test_numbers_out_of_range_are_named(law: Law, poisson: float, words: str) -> None:
    (fault,) = law.faults(poisson)
    assert fault.startswith(words)


def test_the_range_of_convexity_is_said_and_is_where_it_ends() -> None:
    assert not NeoHookean().doubts(0.0)
    assert not Gent(3.0).doubts(0.3)
    assert MooneyRivlin(0.5).doubts(0.24)
    assert not MooneyRivlin(0.5).doubts(0.26)
    soft = Yeoh((-0.02, 0.001))
    (doubt,) = soft.doubts(0.4)
    assert "I1 - 3 = 6.67" in doubt
    bends = [-2 * 0.02 + 6 * 0.001 * first for first in (6.6, 6.7)]  # second derivative of A - 0.02 A^2 + 0.001 A^3
    assert bends[0] < 0.0 < bends[1]
    assert Ogden((2.0, -2.0), (0.5, 0.5)).doubts(0.4)
    assert not Ogden((1.3, 5.0), (0.5, 0.5)).doubts(0.4)
    assert replace(soft, ratios=(0.0, 0.0)).doubts(0.4) == []


def test_readings_inside_are_one_integral_per_region(tmp_path: Path) -> None:
    # the form compiler compares equal expressions of two integrals as trees: for ten minutes with Ogden's law
    given = replace(single(0.02), finite_strain=FiniteStrain(GIVEN["ogden"]))
    model = coarse_rig(coarse_plan(given), tmp_path).model
    regions = [integral.subdomain_id() for integral in model.readings.forms[0].integrals()]
    assert len(regions) == len(set(regions)) == len(model.bulks) == 1
