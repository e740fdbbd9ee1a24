"""The finite-strain model as a library: what users bring gives a scene's answer, on one and two ranks."""

from __future__ import annotations

import io
import json
import re
import runpy
from contextlib import redirect_stdout
from dataclasses import replace
from typing import Any

import pytest

pytest.importorskip("dolfinx")

import ufl

import finite_strain
from finite_strain.mechanics.own_energy import check_own_energy, softening
from linear_bem import FiniteStrain, Gent, Hyperfoam, InvalidProblem, UnsupportedProblem
from tests.finite_strain.scenes import in_form, relatively, single
from tests.launch import mpirun

PROBLEM = single(0.1, poisson=0.3)
MU, LAME = PROBLEM.layer.shear_modulus, PROBLEM.layer.lame_first


def psi(F: Any) -> Any:
    J = ufl.det(F)
    return MU / 2 * (ufl.tr(F.T * F) - 3) - MU * ufl.ln(J) + LAME / 2 * (J - 1) ** 2


def with_law(law: Any) -> Any:
    return replace(PROBLEM, finite_strain=FiniteStrain(law))


PROGRAM = "tests.finite_strain.library"


ON_TWO = """
import json, runpy
from dataclasses import replace
from mpi4py import MPI
import finite_strain
from finite_strain.mpi import on_all
from linear_bem import FiniteStrain, InvalidProblem
from tests.finite_strain.test_library import PROBLEM, PROGRAM, psi

runpy.run_module(PROGRAM, run_name="__main__")
comm, said = MPI.COMM_WORLD, {}

def refuse():
    raise InvalidProblem("no")

def law(F):
    return 1 / 0 if comm.rank else psi(F)

def body(x, y):
    return 1 / 0 if comm.rank else (x**2 + y**2) / 2

ball = replace(PROBLEM.balls[0], shape=body)
for name, run in {
    "function": lambda: on_all(comm, (lambda: 1 / 0) if comm.rank else (lambda: None)),
    "refusal": lambda: on_all(comm, refuse if comm.rank else (lambda: None)),
    "law": lambda: finite_strain.solve(replace(PROBLEM, finite_strain=FiniteStrain(law))),
    "body": lambda: finite_strain.solve(replace(PROBLEM, balls=(ball,))),
}.items():
    try:
        run()
    except Exception as error:
        said[name] = f"{type(error).__name__}: {error}"
said = comm.gather(said)
if said is not None:
    print(json.dumps(said))
"""
"""The program of forty lines on two ranks, and then what each rank hears of a function that fails on the second."""


@pytest.fixture(scope="module")
def on_two() -> Any:
    done = mpirun(2, "-c", ON_TWO, timeout=600.0)
    assert done.returncode == 0, done.stderr
    return [json.loads(line) for line in done.stdout.splitlines()[:2]]


@pytest.mark.parametrize("ranks", [1, pytest.param(2, marks=pytest.mark.mpi)])
def test_forty_lines_reproduce_a_scenes_answer(ranks: int, request: pytest.FixtureRequest) -> None:
    if ranks == 1:  # this process runs them
        with redirect_stdout(io.StringIO()) as out:
            runpy.run_module(PROGRAM, run_name="__main__")
        said = json.loads(out.getvalue())
    else:
        said = request.getfixturevalue("on_two")[0]
    own, named = (said[name]["balls"][0] for name in ("own", "named"))
    assert own["normal_force"] == relatively(named["normal_force"], 1e-8)
    assert own["tangential_force"][0] == relatively(named["tangential_force"][0], 1e-8)
    assert said["own"]["solved"]["linear_solver"].startswith("lu")
    assert said["named"]["solved"]["linear_solver"].startswith("cholesky")  # options end with their run
    assert said["deepest"][-1] == relatively(-0.1, 0.02)  # the surface under the apex is the ball's


def test_an_own_energy_must_have_the_layers_moduli() -> None:
    check_own_energy(with_law(psi))
    for wrong, words in (
        (lambda F: 2 * psi(F), "got 2 Pa and 0.3"),
        (lambda F: psi(F) + ufl.tr(F), "must be objective"),
        (lambda F: psi(F) + ufl.det(F), "no stress at F = I"),
        (lambda F: F, "an expression of ufl with one finite value for every F near I .*, got"),
        (lambda F: psi(F) + 1e-3 * ufl.sqrt((ufl.det(F) - 1) ** 2), "must have second derivatives at F = I, got"),
        (lambda F: 3.0, "must grow with the strain, got 3 Pa near F = I"),
        (lambda F: psi(F) + 0.1 * (F[0, 1] - F[1, 0]) ** 2, r"must be objective, psi\(R F\) = psi\(F\)"),
        (lambda F: psi(F) + (ufl.dot(F.T, F)[0, 0] - 1) ** 3, r"must be isotropic, psi\(F R\) = psi\(F\)"),
        (lambda F: ufl.ln(ufl.det(F) - 2), "one finite value for every F near I .*, got"),
        (lambda F: psi(F) + 0.0 * float("nan"), "must be finite near F = I"),
    ):
        with pytest.raises(InvalidProblem, match=words):
            check_own_energy(with_law(wrong))


def test_an_own_energy_in_another_unit_or_of_another_material_is_named_as_such() -> None:
    for factor in (1e6, 1e-3, 1.1):
        with pytest.raises(InvalidProblem, match=re.escape(f"both are {factor:g} times the layer's: check the units")):
            check_own_energy(with_law(lambda F, factor=factor: factor * psi(F)))
    for wrong, words in (
        (lambda F: psi(F) + LAME / 4 * (ufl.det(F) - 1) ** 2, r"to correct lambda, add -\d"),
        (lambda F: psi(F) + 0.2 * MU * (ufl.dot(F.T, F)[0, 0] - 1) ** 2, "must be isotropic"),
        (lambda F: psi(F) + 0.2 * MU * ufl.dot(F.T, F)[0, 0], "must be isotropic"),
        (lambda F: psi(F) + MU * ufl.tr(F.T * F), "no stress at F = I"),
    ):
        with pytest.raises(InvalidProblem, match=words):
            check_own_energy(with_law(wrong))


def test_an_own_energy_whose_stress_falls_with_the_shear_is_named() -> None:
    def fading(F: Any) -> Any:  # mu/2 (s - 5 s^2), s = shear^2: concave beyond sqrt(1/30) = 0.18
        return psi(F) - 5.0 * MU / 2.0 * (ufl.tr(ufl.dot(F.T, F)) - 3.0 - 2.0 * ufl.ln(ufl.det(F))) ** 2

    assert softening(with_law(psi)) == softening(with_law(Gent(30.0))) == []
    (said,) = softening(with_law(fading))
    assert "in simple shear from about 0.2 on" in said


@pytest.mark.parametrize("limit", [0.3, 0.8, 1.0, 2.0, 30.0])
def test_an_own_energy_may_have_no_value_beyond_a_limit(limit: float, capfd: pytest.CaptureFixture[str]) -> None:
    def first(F: Any) -> Any:
        return ufl.tr(F.T * F) - 3 - 2 * ufl.ln(ufl.det(F))

    def gent(F: Any) -> Any:
        return -MU * limit / 2 * ufl.ln(1 - first(F) / limit) + LAME / 2 * (ufl.det(F) - 1) ** 2

    def isochoric(F: Any) -> Any:
        J = ufl.det(F)
        stretch = (J ** (-2 / 3) * ufl.tr(F.T * F) - 3) / limit
        return -MU * limit / 2 * ufl.ln(1 - stretch) + (LAME / 2 + MU / 3) * (J - 1) ** 2

    def rooted(F: Any) -> Any:
        return MU * limit * (1 - ufl.sqrt(1 - first(F) / limit)) + LAME / 2 * (ufl.det(F) - 1) ** 2

    for law in (gent, isochoric, rooted):
        check_own_energy(with_law(law))
        assert softening(with_law(law)) == []
    assert capfd.readouterr() == ("", "")


def test_an_own_energy_that_resists_rotations_at_large_strain_alone_is_refused() -> None:
    def held(F: Any) -> Any:
        return psi(F) + 100.0 * (F[0, 1] - F[1, 0]) ** 8

    with pytest.raises(InvalidProblem, match="must be objective"):
        check_own_energy(with_law(held))


def test_what_has_no_mixed_form_is_refused_it() -> None:
    for law in (psi, Hyperfoam((8.0,), (1.0,))):
        assert finite_strain.plan(with_law(law))["forms"] == {"layer": "displacement"}
        with pytest.raises(UnsupportedProblem, match=r"elements\.form: .* takes the displacement form"):
            finite_strain.plan(in_form("mixed", with_law(law)))
    with pytest.raises(UnsupportedProblem, match=r"up to 0\.4999, got 0\.5"):
        finite_strain.plan(replace(single(0.1, poisson=0.5), finite_strain=FiniteStrain(psi)))


@pytest.mark.parametrize(
    ("law", "words"),
    [("hook", ""), (3.0, "got 3.0$"), (None, ""), (Gent, r"; give an object, such as Gent\(")],
)
def test_no_law_is_refused(law: Any, words: str) -> None:
    with pytest.raises(InvalidProblem, match=rf"finite_strain\.law: must be.*{words}"):
        with_law(law)


FAILED = "the run or a function of the user failed on rank(s) 1"


@pytest.mark.mpi
def test_a_function_that_fails_on_one_rank_ends_the_run_on_all(on_two: Any) -> None:
    here, there = on_two[1]
    # a run frees its solvers after a ThirdBodyError, which takes all ranks
    assert (here["function"], here["refusal"]) == (f"RuntimeError: {FAILED}", f"ThirdBodyError: {FAILED}")
    assert (there["function"], there["refusal"]) == ("ZeroDivisionError: division by zero", "InvalidProblem: no")


@pytest.mark.mpi
@pytest.mark.parametrize("part", ["law", "body"])
def test_a_law_or_body_that_fails_on_one_rank_ends_the_run_on_all(part: str, on_two: Any) -> None:
    here, there = on_two[1]
    assert here[part] in (f"ThirdBodyError: {FAILED}", f"RuntimeError: {FAILED}")
    assert "division by zero" in there[part]
