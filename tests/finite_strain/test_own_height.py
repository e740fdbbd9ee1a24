"""Heights of own bodies that use functions of numpy, in the form language."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("dolfinx")

import h5py
import ufl
from dolfinx.mesh import create_unit_square
from mpi4py import MPI

import finite_strain
from finite_strain.contact.contact_energy import gap
from finite_strain.contact.symbolic import FUNCTIONS, Symbolic
from finite_strain.force.contact_area import contact_areas
from finite_strain.force.contact_pressure import Extremes
from finite_strain.geometry.estimates import radius_seen
from finite_strain.observer import Silence
from finite_strain.output.field_catalogue import FieldChoice, outline
from finite_strain.output.field_writer import FieldWriter
from finite_strain.refinement_loop import Refinement
from linear_bem import InvalidProblem, UnsupportedProblem, solve
from linear_bem.dual import SLOPES, Dual
from linear_bem.indenter import Ellipsoid, Indenter
from runs.pictures.coloring import COLORINGS
from tests.finite_strain.scenes import COARSER, at_small_strain, coarse_plan, coarse_rig, pair, single


class Bowl(Indenter):
    """A paraboloid."""

    apex_radius = 1.0

    def height(self, x: Any, y: Any) -> Any:
        return 0.5 * (x**2 + y**2)


class WrittenOtherwise(Bowl):
    """The same, with functions of numpy."""

    def height(self, x: Any, y: Any) -> Any:
        r2 = x**2 + y**2
        return np.sqrt(1.0 + r2 + 0.25 * r2**2) - np.cos(x) ** 2 - np.sin(x) ** 2


class Kinked(Bowl):
    """A paraboloid that is steeper from r = 0.2 on, which a contact of 0.1 reaches beyond."""

    def height(self, x: Any, y: Any) -> Any:
        inner = super().height(x, y)
        return np.maximum(inner, 2.0 * inner - 0.02)


class KinkedOtherwise(Bowl):
    """The same without functions of numpy."""

    def height(self, x: Any, y: Any) -> Any:
        inner = super().height(x, y)
        return inner + 0.5 * (inner - 0.02 + abs(inner - 0.02))


@pytest.mark.parametrize("function", SLOPES, ids=lambda function: function.__name__)
def test_every_function_has_the_value_and_slope_of_the_form_language(function: np.ufunc) -> None:
    place = 0.7, 0.4
    one, none = np.ones(1), np.zeros(1)
    dual = Dual(np.array([place[0]]), one, none), Dual(np.array([place[1]]), none, one)
    x = ufl.SpatialCoordinate(create_unit_square(MPI.COMM_SELF, 1, 1))
    operands: list[Any] = [dual[0], Symbolic(x[0])], [dual[1], Symbolic(x[1])]
    if function is np.power:
        operands[1][:] = 2.5, 2.5
    value = function(*(pair[0] for pair in operands[: function.nin]))
    form = function(*(pair[1] for pair in operands[: function.nin])).expression
    slopes = [ufl.algorithms.apply_derivatives.apply_derivatives(ufl.grad(form))[i](place) for i in range(2)]
    assert float(form(place)) == pytest.approx(value.value[0], rel=1e-14)
    assert slopes == pytest.approx([np.ravel(value.dx)[0], np.ravel(value.dy)[0]], rel=1e-13)
    assert set(FUNCTIONS) == set(SLOPES)


def written_as_a_function(x: Any, y: Any) -> Any:
    return WrittenOtherwise().height(x, y)


@pytest.mark.parametrize(
    "bodies",
    [(WrittenOtherwise(), Bowl()), (Kinked(), KinkedOtherwise()), (written_as_a_function, Bowl())],
    ids=["smooth", "kink", "function"],
)
def test_a_height_of_numpy_functions_presses_like_the_same_body(bodies: tuple[Any, Bowl], tmp_path: Path) -> None:
    forces = []
    for number, shape in enumerate(bodies):
        (folder := tmp_path / f"{number}").mkdir()
        model = coarse_rig(coarse_plan(pair(0.1, shape=shape, poisson=0.3)), folder).model
        model.contact.set_approaches(np.array([0.1]))
        model.contact.set_penalties(np.array([30.0]))
        forces.append(model.forces())
    assert abs(forces[1][0, 2]) > 0.01
    assert forces[0] == pytest.approx(forces[1], rel=1e-9, abs=1e-12)


def test_the_pull_of_kinked_bodies_at_small_strain_is_that_of_the_linear_model_within_its_error() -> None:
    problem = at_small_strain(pair(0.1, shape=Kinked(), poisson=0.3))
    found = finite_strain.solve(problem, accuracy=0.3, numerics=COARSER, model="small_strain").balls[0]
    known = solve(problem, 1e-4).balls[0]
    assert abs(found.tangential_force[0] - known.tangential_force[0]) < found.tangential_force_error
    assert found.tangential_force_error < 0.05 * abs(known.tangential_force[0])
    assert found.normal_force == pytest.approx(known.normal_force, rel=0.02)


@pytest.mark.parametrize("finite", [False, True])
@pytest.mark.parametrize("bodies", [(WrittenOtherwise(), Bowl()), (Kinked(), KinkedOtherwise())])
def test_the_written_gap_of_a_height_of_numpy_functions_is_that_of_the_same_body(
    bodies: tuple[Bowl, Bowl], finite: bool
) -> None:
    offset, displacement = np.random.default_rng(1).uniform(-1.0, 1.0, (2, 3, 20))
    one, other = (gap(body, 1.0, offset, displacement, 0.1, finite, 0.3) for body in bodies)
    assert one == pytest.approx(other, rel=1e-12)


def stepped(x: Any, y: Any) -> Any:
    return np.where(x > 0.1, 0.1, 0.0) + 0.5 * (x**2 + y**2)


def summed(x: Any, y: Any) -> Any:
    return 0.5 * np.stack([x, y]).reshape(2, -1).T @ np.ones(2)


@pytest.mark.parametrize("function", [stepped, summed])
def test_a_function_that_cannot_be_differentiated_is_named_with_what_it_must_be(function: Any) -> None:
    with pytest.raises(
        UnsupportedProblem, match=rf"balls\.shape: {function.__name__} must be an expression of .*linear"
    ):
        finite_strain.plan(pair(0.1, shape=function))


def flat(x: Any, y: Any) -> Any:
    return 0.0 * (x + y)


def levelling_off(x: Any, y: Any) -> Any:
    return 0.05 * (1.0 - np.exp(-10.0 * (x**2 + y**2)))


@pytest.mark.parametrize("function", [flat, levelling_off])
def test_a_function_that_does_not_rise_ever_steeper_is_refused(function: Any) -> None:
    with pytest.raises(UnsupportedProblem, match=rf"balls\.shape: {function.__name__} must rise from the axis"):
        finite_strain.plan(pair(0.1, shape=function))


@pytest.mark.parametrize("way", [1.0, 1j, -1.0, -1j])
def test_a_function_with_a_kink_on_its_axis_is_refused_whichever_side_is_the_steeper(way: complex) -> None:
    def ridged(x: Any, y: Any) -> Any:
        return 0.5 * (x**2 + y**2) + 0.3 * np.maximum(way.real * x + way.imag * y, 0.0 * x)

    with pytest.raises(UnsupportedProblem, match=r"ridged must be level at the axis.*slope of 0\.3 next to the axis"):
        finite_strain.plan(single(0.1, shape=ridged))


@pytest.mark.parametrize("way", [1.0, 1j, -1.0, -1j])
def test_a_body_is_looked_at_on_all_four_sides(way: complex) -> None:
    class Side(Bowl):
        beyond, steep = 0.0, 1.5

        def height(self, x: Any, y: Any) -> Any:
            along = way.real * x + way.imag * y - self.beyond
            return super().height(x, y) + 0.25 * self.steep * (along + abs(along)) ** 2

    class Falling(Side):
        beyond, steep = 0.15, -0.75

    # the section at 0.1 m extends sqrt(0.2) m to three sides and half as far to the fourth
    assert radius_seen(Side(), 0.1) == pytest.approx(0.75, rel=1e-9)
    with pytest.raises(InvalidProblem, match=r"Falling\.height must exceed the approach, 0\.1 m"):
        finite_strain.plan(single(0.1, shape=Falling()))


def endless(x: Any, y: Any) -> Any:
    return 0.25 * (x - y) ** 2 + 0.0 * x


class LevellingOff(Bowl):
    """A body that is nowhere higher than 0.05 m."""

    def height(self, x: Any, y: Any) -> Any:
        return levelling_off(x, y)


@pytest.mark.parametrize("shape", [endless, LevellingOff()])
def test_a_body_whose_section_has_no_end_is_refused(shape: Any) -> None:
    with pytest.raises(InvalidProblem, match=r"height must exceed the approach, 0\.1 m, .* give a long body ends"):
        finite_strain.plan(single(0.1, shape=shape))


def steep(x: Any, y: Any) -> Any:
    return 0.5 * (np.exp(x**2 + y**2) - 1.0)


def test_a_steep_function_whose_height_overflows_far_away_is_planned_without_a_warning() -> None:
    assert coarse_plan(pair(0.1, shape=steep)).reduction.planes == (0, 1)


def test_a_run_of_an_own_function_or_class_is_never_resumed(tmp_path: Path) -> None:
    """Its name does not say what it computes."""
    plans = [coarse_plan(pair(0.1, shape=shape)) for shape in ("sphere", written_as_a_function, Bowl())]
    keys = [
        [Refinement(plan, tmp_path, MPI.COMM_SELF, Silence(), None, keep=False).key for _ in range(2)] for plan in plans
    ]
    assert [len(set(each)) for each in keys] == [1, 2, 2]


class Ending(Bowl):
    """A sphere without `reach`: its height has no value beyond its equator."""

    def height(self, x: Any, y: Any) -> Any:
        r2 = x**2 + y**2
        return r2 / (1.0 + (1.0 - r2) ** 0.5)


def test_a_body_whose_height_has_no_value_where_the_layer_may_touch_is_refused() -> None:
    with pytest.raises(InvalidProblem, match=r"Ending\.height must be a real number .* needs the property reach"):
        coarse_plan(pair(0.1, shape=Ending()))


class Dome(Ending):
    reach = 1.0


def test_beyond_its_reach_a_body_may_have_no_height(tmp_path: Path) -> None:
    model = coarse_rig(coarse_plan(single(0.4, poisson=0.3, shape=Dome())), tmp_path).model
    model.contact.set_approaches(np.array([0.4]))
    model.contact.set_penalties(np.array([1.0]))
    # the flat surface crosses the sphere in a circle; points of the facets in or out
    assert contact_areas(model)[0] == pytest.approx(np.pi * (2.0 * 0.4 - 0.4**2), rel=2e-3)
    # the penalty times the volume of the cap; discretisation: the facet rule across the kink
    assert model.forces()[0, 2] == pytest.approx(np.pi * 0.4**2 * (1.0 - 0.4 / 3.0), rel=0.03)
    assert np.isfinite([*model.readings.mean_gaps(), *Extremes(model)().ravel()]).all()


class OvalDome(Dome):
    """An ellipsoid whose `reach` is its longer semi-axis; it has no height beyond the shorter one."""

    def height(self, x: Any, y: Any) -> Any:
        return super().height(x, y / 0.8)


class BluntDome(Dome):
    """A sphere of which a small part about the apex is left."""

    reach = 0.09

    def height(self, x: Any, y: Any) -> Any:
        return super().height(x, y) + 0.0 * (0.09**2 * (1.0 + 1e-9) - x**2 - y**2) ** 0.5


def test_a_body_with_an_edge_may_have_no_height_beside_its_shorter_axis() -> None:
    for approach, tolerance in ((0.1, 1e-9), (0.9, 0.06)):  # or the last point in the search that has a height
        seen = radius_seen(Ellipsoid((1.0, 0.8, 1.0)), approach)
        assert radius_seen(OvalDome(), approach) == pytest.approx(seen, rel=tolerance)
    plan = coarse_plan(pair(0.1, shape=OvalDome()))
    assert plan.reduction.planes == (0, 1)
    assert 0.9 < outline(plan.reduction.balls[0])[..., 2].max() < 1.0


def test_the_written_gap_is_infinite_where_no_body_has_a_height(tmp_path: Path) -> None:
    """Warnings are errors in tests: neither the gap nor the outline may raise one."""
    rig = coarse_rig(coarse_plan(pair(0.1, poisson=0.3, shape=Dome())), tmp_path)
    FieldWriter(rig.model, tmp_path, FieldChoice(("gap",))).write(1, 1.0)
    with h5py.File(tmp_path / "step_0001.h5") as file:
        gaps, outlines = file["node_fields/gap"][:], file["ball_outlines"][:]
        x, y, _ = np.abs(file["points"][:]).T
    nearest, finite = np.hypot(x - 1.0, y), np.isfinite(gaps)
    assert finite[nearest < 1.0 - 1e-9].all()
    assert np.all(gaps[nearest > 1.0 + 1e-9] == np.inf)
    assert outlines[..., 2].max() == pytest.approx(1.0, abs=1e-4)  # slope at the edge
    assert COLORINGS["gap"].limits(gaps) == (gaps.min(), gaps[finite].max())


def test_a_body_that_ends_near_its_apex_is_looked_at_within_its_edge() -> None:
    assert single(0.001, shape=BluntDome()).size == 1
