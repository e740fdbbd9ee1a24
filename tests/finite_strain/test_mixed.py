"""The mixed form: its derivatives, its stability up to nu = 1/2, and agreement with the displacement form."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from scipy.linalg import eigh

pytest.importorskip("dolfinx")

import dolfinx
import ufl

from finite_strain import compat, one_discretisation
from finite_strain.geometry.extent import Extent
from finite_strain.mechanics.volumetric import describe_forms
from finite_strain.one_discretisation import MeshRun
from finite_strain.planning.records import Discretisation
from linear_bem import Elastic, FiniteStrain, Layer, Load, Problem
from linear_bem.closed_forms import indentation_of_layer, long_force
from tests.finite_strain.scenes import (
    CUBIC,
    QUADRATIC,
    SHAPES,
    STIFF_SUBSTRATE,
    balls_at,
    coarse_plan,
    coarse_rig,
    in_form,
    pair,
    relatively,
    single,
)

if TYPE_CHECKING:
    from pathlib import Path

    from finite_strain.discretisation.discrete_model import Model
    from tests.finite_strain.scenes import Rig

CASES = {
    "finite strain": ("finite_strain", 0.4999, STIFF_SUBSTRATE),
    "finite strain, incompressible": ("finite_strain", 0.5, STIFF_SUBSTRATE),
    "small strain, incompressible": ("small_strain", 0.5, None),
    "both regions incompressible": ("finite_strain", 0.5, Elastic(2.0, 0.5)),
}


def coarse_model(problem: Problem, kind: str, folder: Path) -> Model:
    return coarse_rig(coarse_plan(problem, kind), folder).model


@pytest.fixture(scope="module", params=CASES)
def model(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Model:
    """A quarter of a pair with a thousand unknowns, its ball pressed in, with nonzero multipliers."""
    kind, poisson, substrate = CASES[request.param]
    problem = pair(0.1, poisson=poisson, substrate=substrate, shape=SHAPES[kind])
    model = coarse_model(problem, kind, tmp_path_factory.mktemp("mixed"))
    model.contact.set_approaches(np.array([0.07]))
    model.contact.set_penalties(np.array([30.0]))
    model.contact.augment(model.contact.penalised, 1.0)
    model.contact.set_approaches(np.array([0.1]))
    return model


def direction(model: Model, seed: int, scale: float) -> np.ndarray:
    """Return a random change of all unknowns in a solver's order, smooth in space, zero where constrained."""
    random = np.random.default_rng(seed)
    parts = []
    held = [model.constrained, *(idle_rows(model, k) for k in range(len(model.fields.pressures)))]
    for points, count, fixed in zip(model.fields.points, model.fields.owned, held, strict=True):
        waves = random.uniform(-1.5, 1.5, (4, 3))
        shape = fixed.shape[1:]
        values = sum(np.multiply.outer(np.sin(points @ wave), random.uniform(-1.0, 1.0, shape)) for wave in waves)
        values = np.asarray(values) * np.exp(points[:, 2]).reshape(-1, *(1,) * len(shape))
        values[fixed] = 0.0
        parts.append(values[:count].ravel())
    return scale * np.concatenate(parts)


def idle_rows(model: Model, number: int) -> np.ndarray:
    rows = np.zeros(len(model.fields.pressures[number].x.array), dtype=bool)
    rows[[bulk.idle for bulk in model.bulks if bulk.idle is not None][number]] = True
    return rows


class At:
    """Energy, residual and tangent of a model as functions of one array of all its unknowns."""

    def __init__(self, model: Model) -> None:
        self.model = model
        self.x, self.b = model.matrix.createVecs()

    def go(self, values: np.ndarray) -> None:
        self.x.array[:] = values
        self.model.fields.set(self.x)

    def energy(self, values: np.ndarray) -> float:
        self.go(values)
        return self.model.energy()

    def residual(self, values: np.ndarray) -> np.ndarray:
        self.go(values)
        self.model.residual(self.b)
        return self.b.array.copy()

    def tangent(self, values: np.ndarray, change: np.ndarray) -> np.ndarray:
        self.go(values)
        self.model.tangent()
        self.x.array[:] = change
        self.model.matrix.mult(self.x, self.b)
        return self.b.array.copy()


def test_the_residual_is_the_derivative_of_the_potential_by_displacement_and_pressure(model: Model) -> None:
    at, state, v = At(model), direction(model, 1, 0.01), direction(model, 2, 1.0)
    slope = float(at.residual(state) @ v)
    steps = np.array([4e-3, 2e-3, 1e-3, 5e-4])
    remainders = [abs(at.energy(state + s * v) - at.energy(state) - s * slope) for s in steps]
    orders = np.diff(np.log(remainders)) / np.diff(np.log(steps))
    # theory: the potential has a continuous first derivative, so Taylor's remainder is of second order
    assert orders == pytest.approx(2.0, abs=0.05)


def test_the_tangent_is_the_derivative_of_the_residual_and_symmetric(model: Model) -> None:
    at, state, v, step = At(model), direction(model, 1, 0.01), direction(model, 3, 1.0), 1e-6
    difference = (at.residual(state + step * v) - at.residual(state - step * v)) / (2.0 * step)
    product = at.tangent(state, v)
    for part in model.fields.ranges:  # forces and volume equations each for itself
        assert np.linalg.norm(product[part] - difference[part]) < 1e-6 * np.linalg.norm(difference[part])
    assert model.matrix.isSymmetric(1e-10)


def test_a_pressure_is_confined_to_its_own_region(model: Model) -> None:
    At(model).go(direction(model, 1, 0.01))
    model.tangent()
    start = model.fields.ranges[0].stop
    bottom = model.mesh.geometry.x[:, 2].min()
    for number, part in enumerate(model.fields.ranges[1:]):
        idle, depths = idle_rows(model, number), model.fields.points[number + 1][:, 2]
        inside = depths >= -1.16 - 1e-9 if number == 0 else depths <= -1.16 + 1e-9
        assert np.array_equal(idle, ~inside)
        assert np.any(idle) == (bottom < -1.2)
        for row in np.flatnonzero(idle)[::17]:
            columns, values = model.matrix.getRow(part.start + row)
            assert values[columns == part.start + row] == 1.0
            assert np.count_nonzero(values) == 1
    assert start == 3 * len(model.nodal)


@pytest.mark.parametrize("kind", SHAPES)
def test_a_scene_in_displacement_form_has_no_trace_of_the_mixed_one(kind: str, tmp_path: Path) -> None:
    model = coarse_model(pair(0.1, poisson=0.3, substrate=STIFF_SUBSTRATE, shape=SHAPES[kind]), kind, tmp_path)
    assert model.unknowns == 3 * len(model.nodal)
    assert model.fields.functions == [model.displacement]
    form = model.volume_integral(lambda psi, _: psi)
    shapes = sorted(c.ufl_shape for c in form.coefficients())
    assert shapes[:2] == [(), ()], "mu and lambda of the cells"
    assert set(shapes[2:]) == {(3,)}, "displacements"
    if kind == "small_strain":
        strain = ufl.sym(ufl.variable(ufl.grad(model.displacement)))
        cells = compat.function_space(model.mesh, 0, discontinuous=True)
        shear, lame = (dolfinx.fem.Function(cells) for _ in range(2))
        density = shear * ufl.inner(strain, strain) + lame / 2 * ufl.tr(strain) ** 2
        written = density * ufl.dx(model.mesh, metadata={"quadrature_degree": 4})
        assert form.signature() == written.signature()


def least_singular_value(model: Model) -> float:
    """Return the discrete inf-sup constant of displacement and pressure, in the norms of shear energy and p^2 / mu."""
    model.fields.restore(model.fields.like().copy())
    model.contact.set_approaches(np.array([-1.0]))
    model.tangent()
    dense = model.matrix.convert("dense").getDenseArray().copy()
    u, p = model.fields.ranges
    free = np.flatnonzero(~model.constrained.ravel())
    coupling = dense[p, u][:, free]
    schur = coupling @ np.linalg.solve(dense[u, u][np.ix_(free, free)], coupling.T)
    space = model.fields.pressures[0].function_space
    trial, test = (f(space) for f in (ufl.TrialFunction, ufl.TestFunction))
    mass = dolfinx.fem.petsc.assemble_matrix(compat.compile_form(trial * test * ufl.dx, model.comm))
    mass.assemble()
    shear = model.bulks[0].solid.shear_modulus
    return float(np.sqrt(eigh(schur, shear * mass.convert("dense").getDenseArray(), eigvals_only=True)[0]))


def test_the_inf_sup_constant_does_not_shrink_with_the_elements(tmp_path_factory: pytest.TempPathFactory) -> None:
    constants = []
    for fineness in (1.0, 2.0):
        plan = coarse_plan(single(0.1, poisson=0.5), "small_strain")
        rig = coarse_rig(plan, tmp_path_factory.mktemp("stable"), Discretisation(2, fineness))
        constants.append(least_singular_value(rig.model))
    # theory: bounded below; equal orders or constant pressures on linear displacements lose it with the size
    assert min(constants) > 0.2
    assert constants[-1] > 0.8 * constants[0]


def test_cubic_displacements_with_quadratic_pressures_are_as_stable(tmp_path: Path) -> None:
    rig = coarse_rig(coarse_plan(single(0.1, poisson=0.5), "small_strain"), tmp_path, CUBIC)
    assert len(rig.model.fields.points[1]) > 5 * rig.model.linear_space.dofmap.index_map.size_local  # quadratic ones
    assert least_singular_value(rig.model) > 0.2


def pressed(problem: Problem, kind: str, folder: Path, level: Discretisation = QUADRATIC) -> Rig:
    rig = coarse_rig(coarse_plan(problem, kind), folder, level)
    *_, last = rig.press()
    rig.path.augment(last)
    return rig


def wide(problem: Problem) -> Extent:
    """Return an extent so large that closed forms for an infinite layer apply."""
    return Extent(max(6.0 * problem.layer.thickness, 5.0 * problem.balls[0].radius), 0.0)


@pytest.mark.parametrize(("chi", "poisson"), [(0.3, 0.5), (1.0, 0.48), (1.0, 0.4999)])
def test_one_ball_meets_the_exact_linear_layer_up_to_incompressible(chi: float, poisson: float, tmp_path: Path) -> None:
    approach = 0.04
    problem = single(approach, approach**0.5 / chi, poisson, "paraboloid")
    exact = indentation_of_layer(problem.layer, None, 1.0, approach=approach)
    plan = coarse_plan(problem, "small_strain", extent=wide(problem))
    rig = coarse_rig(plan, tmp_path, CUBIC)
    *_, last = rig.press()
    rig.path.augment(last)
    # discretisation: two cubic elements per contact radius
    assert rig.normal_forces()[0] == relatively(exact.normal_force, 0.02)


def test_pressures_have_no_checkerboard_and_tend_to_the_incompressible_ones(
    tmp_path_factory: pytest.TempPathFactory,
) -> None:
    fields, ripples = [], []
    plan = coarse_plan(single(0.05, 0.5, 0.5))
    for poisson in (0.49, 0.4999, 0.5):  # on one mesh
        rig = coarse_rig(
            replace(plan, problem=single(0.05, 0.5, poisson)), tmp_path_factory.mktemp("smooth"), Discretisation(2, 1.5)
        )
        rig.press()
        fields.append(rig.model.fields.pressures[0].x.array * rig.model.bulks[0].solid.shear_modulus)
        ripples.append(ripple(rig.model))
    # at 0.49 compression ties pressures to displacements: what they ripple there is the mesh's resolution
    assert ripples[0] < 0.2
    assert max(ripples) < 1.1 * ripples[0]
    size = np.abs(fields[-1]).max()
    far, near = (np.abs(field - fields[-1]).max() / size for field in fields[:2])
    # theory: the difference is in proportion to 1/2 - nu, a hundred times smaller; a free mode would grow instead
    assert near < 0.02 * far
    assert far < 0.2


def ripple(model: Model) -> float:
    """Return by how much pressures differ from the mean over their neighbours, root mean square over that of pressures.

    One for a checkerboard; of the order of the element size over the contact radius, squared, for a smooth field.
    """
    pressure, cells = model.fields.pressures[0].x.array, compat.cell_dofs(model.linear_space)
    total, count = np.zeros_like(pressure), np.zeros_like(pressure)
    for k in range(8):
        others = np.delete(cells, k, axis=1)
        np.add.at(total, cells[:, k], pressure[others].sum(axis=1))
        np.add.at(count, cells[:, k], 7.0)
    return float(np.linalg.norm(pressure - total / count) / np.linalg.norm(pressure) / 2.0)


@pytest.mark.parametrize("kind", SHAPES)
def test_both_forms_agree_where_both_are_valid(kind: str, tmp_path_factory: pytest.TempPathFactory) -> None:
    answers: dict[str, list[float]] = {"displacement": [], "mixed": []}
    for form, values in answers.items():
        for level in (QUADRATIC, CUBIC):
            problem = in_form(form, single(0.05, 1.0, 0.46, SHAPES[kind]))
            rig = pressed(problem, kind, tmp_path_factory.mktemp("both"), level)
            values.append(rig.normal_forces()[0])
    coarse, fine = (abs(answers["displacement"][k] / answers["mixed"][k] - 1.0) for k in (0, 1))
    # discretisation: the displacement form's error, which shrinks with the elements
    assert fine < 0.01
    assert fine < 0.75 * coarse


@pytest.mark.parametrize("thickness", [1.0, 2.0])
def test_a_ball_pressed_deep_meets_the_published_incompressible_law(
    thickness: float, tmp_path_factory: pytest.TempPathFactory
) -> None:
    problem = single(0.5, thickness, 0.5)
    plan = coarse_plan(problem, extent=wide(problem))
    rig = coarse_rig(plan, tmp_path_factory.mktemp("deep"), CUBIC)
    for record in rig.path.steps([0.25, 0.5, 1.0]):
        if record.fraction >= 0.5:  # where the elements resolve the contact
            assert rig.path.augment(record)
            expected = long_force(record.fraction * 0.5, 1.0, problem.layer, thickness)
            # theory: the fit's own 0.6 %, and discretisation
            assert rig.normal_forces()[0] == relatively(expected, 0.015)


@pytest.fixture(scope="module")
def incompressible(tmp_path_factory: pytest.TempPathFactory) -> Rig:
    return pressed(single(0.1, 1.0, 0.5), "finite_strain", tmp_path_factory.mktemp("incompressible"))


def test_the_base_reaction_balances_the_balls_when_incompressible(incompressible: Rig) -> None:
    assert 4.0 * incompressible.model.base_reaction() == relatively(incompressible.normal_forces()[0], 1e-8)


def test_an_incompressible_layer_keeps_its_volume(incompressible: Rig) -> None:
    model = incompressible.model
    F = ufl.Identity(3) + ufl.grad(model.displacement)
    measure = ufl.dx(metadata={"quadrature_degree": 4})
    change, size = (
        dolfinx.fem.assemble_scalar(compat.compile_form(value * measure, model.comm))
        for value in (ufl.det(F) - 1, abs(ufl.tr(ufl.grad(model.displacement))))
    )
    # solver: the constant pressure's own equation is closed to the residual's norm
    assert abs(change) < 1e-7 * size


def test_the_answer_does_not_depend_on_the_unit_of_length(tmp_path_factory: pytest.TempPathFactory) -> None:
    answers = []
    for metre, pascal in ((1.0, 1.0), (2.0**-8, 2.0**21)):
        load = Load("approach", (0.1 * metre,))
        problem = Problem(Layer(pascal, 0.5, metre), balls_at((0.0, 0.0), radius=metre), load)
        plan = coarse_plan(problem, extent=Extent(1.7 * metre, 0.0))
        rig = coarse_rig(plan, tmp_path_factory.mktemp("units"))
        records = rig.press()
        answers.append((rig.normal_forces()[0] / (pascal * metre**2), sum(r.newton_iterations for r in records)))
    assert answers[1][0] == relatively(answers[0][0], 1e-8)  # solver, on equal meshes: powers of two scale exactly
    assert abs(answers[1][1] - answers[0][1]) <= 3


def test_the_pair_has_elements_of_the_same_form(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(one_discretisation, "ModelRun", lambda plan, *_: plan.problem)
    solid = pair(0.1, poisson=0.495, substrate=STIFF_SUBSTRATE)
    mu, lame = solid.layer.shear_modulus, solid.layer.lame_first

    def psi(F: Any) -> Any:
        J = ufl.det(F)
        return mu / 2 * (ufl.inner(F, F) - 3 - 2 * ufl.ln(J)) + lame / 2 * (J - 1) ** 2

    for problem in (solid, in_form("displacement", solid), replace(solid, finite_strain=FiniteStrain(psi))):
        run: Any = MeshRun(coarse_plan(problem), QUADRATIC, *[None] * 4)
        assert run.small.finite_strain is None
        assert describe_forms(run.small) == describe_forms(run.own)
