"""Every law against its paper's closed forms, its small-strain limit, and exact tangents where stretches coincide."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

pytest.importorskip("dolfinx")

import dolfinx
import ufl
from mpi4py import MPI

from finite_strain import compat
from finite_strain.mechanics.kinematics import Finite
from finite_strain.mechanics.volumetric import Compressible, Mixed
from linear_bem import Gent, Hyperfoam, Layer, MooneyRivlin, NeoHookean, Ogden, Yeoh
from linear_bem.law import LAWS, Law
from tests.finite_strain.scenes import relatively

LAYER = Layer(1.0, 0.3, 1.0)
MU, LAMBDA = LAYER.shear_modulus, LAYER.lame_first
GIVEN: dict[str, Law] = {
    "neo_hookean": NeoHookean(), "mooney_rivlin": MooneyRivlin(0.3), "yeoh": Yeoh((-0.02, 0.001)), "gent": Gent(20.0),
    "ogden": Ogden((1.3, 5.0, -2.0), (0.6, 0.3, 0.1)), "hyperfoam": Hyperfoam((8.0, -2.0), (0.7, 0.3)),
}  # fmt: skip
Stretches = np.ndarray


def parts(l: Stretches) -> tuple[complex, complex, complex]:  # noqa: E741  (the papers' letter)
    """Return A = I1 - 3 - 2 ln J, B = I2 - 3 - 4 ln J and J of stretches (3,), as the textbooks write them."""
    J = l[0] * l[1] * l[2]
    return sum(l**2) - 3 - 2 * np.log(J), sum((J / l) ** 2) - 3 - 4 * np.log(J), J


def textbook(name: str, l: Stretches) -> complex:  # noqa: E741
    """Return the strain energy as its paper has it; complex stretches give its exact derivatives."""
    A, B, J = parts(l)
    U = LAMBDA / 2 * (J - 1) ** 2
    match GIVEN[name]:
        case MooneyRivlin(s):
            return MU / 2 * ((1 - s) * A + s * B) - s * MU * (J - 1) ** 2 + U
        case Yeoh((c, d)):
            return MU / 2 * (A + c * A**2 + d * A**3) + U
        case Gent(limit):
            return -MU / 2 * limit * np.log(1 - A / limit) + U
        case Ogden(a, w):
            return sum(2 * MU * y / x**2 * (sum(l**x) - 3 - x * np.log(J)) for x, y in zip(a, w, strict=True)) + U
        case Hyperfoam(a, w):
            b = LAMBDA / (2 * MU)
            return sum(2 * MU * y / x**2 * (sum(l**x) - 3 + (J ** (-x * b) - 1) / b) for x, y in zip(a, w, strict=True))
    return MU / 2 * A + U


class Point:
    """Energy, stress and tangent of a law at one point, through compiled forms as the models have them."""

    def __init__(self, law: Law, mixed: bool = False, lame: float = LAMBDA) -> None:
        mesh = dolfinx.mesh.create_unit_cube(MPI.COMM_SELF, 1, 1, 1)
        self.H, self.one, self.other = (dolfinx.fem.Constant(mesh, np.zeros((3, 3))) for _ in range(3))
        self.p, self.lame = dolfinx.fem.Constant(mesh, 0.0), lame
        volumetric = Mixed(self.p, 1.0 / lame) if mixed else Compressible(dolfinx.fem.Constant(mesh, lame))
        H = ufl.variable(self.H)
        psi = Finite(law).energy_density(H, dolfinx.fem.Constant(mesh, MU), volumetric, self.H)
        stress = ufl.inner(ufl.diff(psi, H), self.one)
        dx = ufl.Measure("dx", domain=mesh, metadata={"quadrature_degree": 0})
        forms = [value * dx for value in (psi, stress, ufl.inner(ufl.diff(stress, H), self.other))]
        self._energy, self._stress, self._tangent = compat.compile_forms(forms, MPI.COMM_SELF)

    def at(self, H: np.ndarray) -> None:
        self.H.value[:] = H
        self.p.value = self.lame * (np.linalg.det(np.eye(3) + H) - 1.0) if np.isfinite(self.lame) else 0.3

    def energy(self, H: np.ndarray) -> float:
        self.at(H)
        return float(dolfinx.fem.assemble_scalar(self._energy))

    def stress(self, H: np.ndarray) -> np.ndarray:
        self.at(H)
        return np.array([[self._along(self._stress, i, j) for j in range(3)] for i in range(3)])

    def tangent(self, H: np.ndarray) -> np.ndarray:
        self.at(H)
        answer = np.zeros((3, 3, 3, 3))
        for k, m in np.ndindex(3, 3):
            self.other.value[:] = 0.0
            self.other.value[k, m] = 1.0
            answer[:, :, k, m] = [[self._along(self._tangent, i, j) for j in range(3)] for i in range(3)]
        return answer

    def _along(self, form: object, i: int, j: int) -> float:
        self.one.value[:] = 0.0
        self.one.value[i, j] = 1.0
        return float(dolfinx.fem.assemble_scalar(form))


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
    "neo_hookean": lambda l: MU * (l**2 - 1 / l),
    "mooney_rivlin": lambda l: MU * (0.7 + 0.3 / l) * (l**2 - 1 / l),
    "yeoh": lambda l: MU * (l**2 - 1 / l) * (1 - 0.04 * (l**2 + 2 / l - 3) + 0.003 * (l**2 + 2 / l - 3) ** 2),
    "gent": lambda l: MU * (l**2 - 1 / l) * 20 / (20 - (l**2 + 2 / l - 3)),
    "ogden": lambda l: sum(2 * MU * w / a * (l**a - l ** (-a / 2)) for a, w in ((1.3, 0.6), (5.0, 0.3), (-2.0, 0.1))),
}
BIAXIAL = {
    "neo_hookean": lambda l: MU * (l**2 - l**-4),
    "mooney_rivlin": lambda l: MU * (0.7 + 0.3 * l**2) * (l**2 - l**-4),
    "yeoh": lambda l: MU * (l**2 - l**-4) * (1 - 0.04 * (2 * l**2 + l**-4 - 3) + 0.003 * (2 * l**2 + l**-4 - 3) ** 2),
    "gent": lambda l: MU * (l**2 - l**-4) * 20 / (20 - (2 * l**2 + l**-4 - 3)),
    "ogden": lambda l: sum(2 * MU * w / a * (l**a - l ** (-2 * a)) for a, w in ((1.3, 0.6), (5.0, 0.3), (-2.0, 0.1))),
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
        assert cell.stress(np.diag(stretches - 1.0)).diagonal() == pytest.approx(np.where(sides, nominal, 0.0), rel=1e-8)


@pytest.mark.parametrize(
    "law", [MooneyRivlin(0.0), Yeoh((0.0, 0.0)), Gent(1e12), Ogden((2.0,), (1.0,))], ids=lambda law: law.name
)
def test_laws_without_their_own_numbers_are_neo_hookean(law: Law) -> None:
    cell, plain = Point(law), Point(NeoHookean())
    for stretches in STATES:
        H = turns(1)[0].T @ np.diag(stretches - 1.0) @ turns(1)[0]
        assert cell.stress(H) == pytest.approx(plain.stress(H), abs=1e-11)
        assert cell.tangent(H) == pytest.approx(plain.tangent(H), abs=1e-11)


def exact_tangent(slope: Callable[[float], float], bend: Callable[[float], float], l: np.ndarray) -> np.ndarray:  # noqa: E741
    """Return dP/dF of an energy sum f(l_i) at F = diag(l), of its f' and f''; stretches equal or well apart."""
    answer = np.zeros((3, 3, 3, 3))
    for i, j in np.ndindex(3, 3):
        if i == j:
            answer[i, i, i, i] = bend(l[i])
            continue
        plus = (slope(l[i]) + slope(l[j])) / (l[i] + l[j])
        minus = bend(0.5 * (l[i] + l[j])) if abs(l[i] - l[j]) < 1e-5 else (slope(l[i]) - slope(l[j])) / (l[i] - l[j])
        answer[i, j, i, j], answer[i, j, j, i] = 0.5 * (minus + plus), 0.5 * (minus - plus)
    return answer


@pytest.mark.parametrize("exponent", [-2.0, 0.5, 8.0])
def test_tangents_are_exact_where_stretches_coincide(exponent: float) -> None:
    shear = 2.0 * MU / exponent
    cell = Point(Ogden((exponent,), (1.0,)), lame=0.0)
    for apart in (1e-3, 1e-6, 1e-9, 0.0):
        for near in ((1.5, 1.5 + apart, 0.6), (0.5, 0.5 + apart, 1.3), (1.2, 1.2 + apart, 1.2 + 2.7 * apart)):
            l = np.array(near)  # noqa: E741
            exact = exact_tangent(
                lambda x: shear * (x ** (exponent - 1) - 1 / x),
                lambda x: shear * ((exponent - 1) * x ** (exponent - 2) + 1 / x**2),
                l,
            )
            for turn in (np.eye(3), *turns(2)):
                turned = np.einsum("ai,bj,ck,dl,abcd->ijkl", turn, turn, turn, turn, exact)
                H = turn.T @ np.diag(l - 1.0) @ turn
                # the reference itself loses 1e-16 / apart where it takes a quotient of differences
                limit = 1e-13 + (1e-15 / apart if apart > 1e-5 else 0.0)
                assert np.abs(cell.tangent(H) - turned).max() < limit * np.abs(exact).max()


@pytest.mark.parametrize(
    ("law", "poisson", "words"),
    [
        (MooneyRivlin(1.2), 0.4, "share: must lie between 0 and 1, got 1.2"),
        (Yeoh((-0.1, 0.001)), 0.4, "ratios: must give an energy that grows"),
        (Yeoh((0.1,)), 0.4, "ratios: must be two numbers"),
        (Gent(-3.0), 0.4, "limit: must be greater than 0, got -3"),
        (Gent(float("nan")), 0.4, "limit: must be finite"),
        (Ogden((2.0, 0.0), (0.5, 0.5)), 0.4, "exponents: must not be zero"),
        (Ogden((2.0,), (0.5, 0.5)), 0.4, "weights: needs one for each exponent, got 2 for 1"),
        (Ogden((2.0, 3.0), (0.5, 0.4)), 0.4, "weights: must be greater than 0 and add up to 1"),
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
