"""What the model's end changes, known from linear theory: against other kernels, and against larger models."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from finite_strain.domain import Resolution, box_to_mesh, reduce_scene, scene_positions
from finite_strain.extent import Extent, choose_extent, far_field, scale_of_force
from finite_strain.far_field import Stack, response
from linear_bem import Elastic, Layer, Load
from linear_bem.kernel import LayeredKernel
from linear_bem.response import LayerResponse
from tests.finite_strain.scenes import Rig, coarse_plan, coarse_rig, pair, relatively

LAYER = Layer(1.0, 0.48, 1.16)
SUBSTRATES = {"rigid": None, "stiff": Elastic(1e3, 0.3), "ten times": Elastic(10.0, 0.3), "as soft": Elastic(1.0, 0.3)}
RESOLUTION = Resolution(0.25, 0.2, 0.4)
MESHES = 0.01
"""Discretisation: relative differences of T between two such meshes."""
QUADRATURE = 1e-5
"""Relative: splines in the logarithm and a smooth end of the oscillating integral."""


@pytest.mark.parametrize("poisson", [0.3, 0.48, 0.5])
@pytest.mark.parametrize("substrate", SUBSTRATES.values(), ids=SUBSTRATES)
def test_the_response_of_an_unbounded_stack_is_the_linear_models(substrate: Elastic | None, poisson: float) -> None:
    layer, t = Layer(1.0, poisson, 1.0), np.geomspace(1e-2, 20.0, 50)
    expected = LayerResponse(layer, substrate)(t)
    # roundoff: waves of either sign are alike at long wavelengths
    assert response(t, layer, substrate, math.inf) == relatively(expected, 1e-8)


def test_a_substrate_of_the_layers_material_only_makes_the_layer_thicker() -> None:
    layer, t = Layer(1.0, 0.48, 1.0), np.geomspace(1e-3, 5.0, 30)
    for depth in (0.5, 4.0, 40.0):
        thick = response(t * (1.0 + depth), Layer(1.0, 0.48, 1.0 + depth), None, 0.0)
        assert response(t, layer, layer, depth) == relatively(thick, 1e-6)


@pytest.mark.parametrize("depth", [1.0, 20.0])
@pytest.mark.parametrize("substrate", SUBSTRATES.values(), ids=SUBSTRATES)
def test_a_stack_and_what_lies_beyond_it_are_the_linear_models_kernel(substrate: Elastic | None, depth: float) -> None:
    stack, r = Stack(LAYER, substrate, depth), np.array([0.3, 1.0, 2.0, 5.0])
    kernel = LayeredKernel(LAYER, substrate)
    (value, slope), (more, steeper) = stack.kernel(r), stack.beyond(r)
    assert value - more == pytest.approx(kernel.displacement(r), rel=QUADRATURE, abs=QUADRATURE * value[0])
    assert slope - steeper == relatively(kernel.slope(r), QUADRATURE)


def test_the_effect_fades_with_the_extent_and_vanishes_without_an_end() -> None:
    problem, positions = pair(0.1, substrate=Elastic(10.0, 0.3)), np.array([[-1.0, 0.0], [1.0, 0.0]])
    forces = np.array([0.08, 0.08])
    effects = [
        abs(far_field(problem, positions, (0, 1), Extent(size, size)).approaches(forces)[0])
        for size in (4.0, 8.0, 16.0, 1e5)
    ]
    assert effects[0] > effects[1] > effects[2]
    assert effects[3] < 1e-4 * effects[0]


def test_images_pull_a_ball_towards_the_nearer_side_of_an_attracting_layer() -> None:
    positions = np.array([[-1.0, 0.0], [1.0, 0.0]])
    problem = pair(0.1, thickness=20.0)
    far = far_field(problem, positions, (0, 1), Extent(3.0, 0.0))
    excess = far.tangential_forces(np.array([0.1, 0.1]))
    assert excess[1, 0] > 0.0
    assert excess[0] == pytest.approx([-excess[1, 0], 0.0], abs=1e-12 * excess[1, 0])


def test_a_more_accurate_force_takes_a_larger_model_and_a_thicker_layer_too() -> None:
    positions = np.array([[-1.0, 0.0], [1.0, 0.0]])

    def extent(accuracy: float, substrate: Elastic | None, thickness: float = 1.16) -> Extent:
        problem = pair(0.1, substrate=substrate, thickness=thickness)
        return choose_extent(problem, positions, (0, 1), [(0.1, 0.08, 0.35)] * 2, accuracy)

    soft, stiff = Elastic(10.0, 0.3), Elastic(1e3, 0.3)
    assert extent(0.06, soft).depth < extent(0.02, soft).depth < extent(0.005, soft).depth
    assert extent(0.02, stiff).depth < extent(0.02, soft).depth
    assert extent(0.005, None).margin > extent(0.06, None).margin
    assert extent(0.02, None, 6.0).margin > extent(0.02, None).margin
    assert extent(0.02, None).depth == 0.0


def test_near_a_zero_of_the_force_errors_are_measured_against_the_half_spaces_attraction() -> None:
    forces = np.array([0.08, 0.08])
    scale = scale_of_force(pair(0.1), forces)
    assert scale == relatively(0.1 * 0.08**2 * (1.0 - 0.48**2) / (math.pi * 4.0), 1e-12)
    assert scale == scale_of_force(pair(0.1, thickness=6.0), forces)


def pressed(substrate: Elastic | None, extent: Extent, folder: Path) -> Rig:
    """Press the small-strain pair in on one coarse mesh of some extent."""
    folder.mkdir()
    problem = pair(Load("approach", (0.1, 0.1)), substrate=substrate, shape="paraboloid")
    plan = coarse_plan(problem, "small_strain", RESOLUTION, 0.35)
    reduction = reduce_scene(problem)
    box = box_to_mesh(problem, reduction, RESOLUTION, 0.35, extent)
    rig = coarse_rig(replace(plan, boxes=(box, box)), folder)
    rig.press()
    return rig


@pytest.mark.slow
@pytest.mark.parametrize(
    ("substrate", "small", "large"),
    [
        (None, Extent(1.9, 0.0), Extent(6.0, 0.0)),
        (Elastic(1e3, 0.3), Extent(2.0, 0.6), Extent(6.0, 3.0)),
        (Elastic(10.0, 0.3), Extent(3.0, 3.0), Extent(12.0, 16.0)),
        (Elastic(1.0, 0.48), Extent(4.0, 4.0), Extent(16.0, 24.0)),
    ],
    ids=["rigid", "stiff", "ten times", "as soft"],
)
def test_the_effect_foretold_is_what_a_larger_model_changes(
    substrate: Elastic | None, small: Extent, large: Extent, tmp_path: Path
) -> None:
    forces, ratios, foretold, lift = [], [], [], []
    for number, extent in enumerate((small, large)):
        rig = pressed(substrate, extent, tmp_path / str(number))
        force = float(rig.path.normal_forces()[0])
        forces.append(force)
        ratios.append(rig.meter.domain(rig.contact_radii())[0, 0] / force**2)
        reduction = rig.plan.reduction
        far = far_field(rig.plan.problem, scene_positions(reduction), reduction.planes, extent)
        own = reduction.balls[0].index
        foretold.append(far.tangential_forces(np.full(2, force))[own, 0] / force**2)
        lift.append(far.approaches(np.full(2, force))[own])
    change, expected = ratios[0] - ratios[1], foretold[0] - foretold[1]
    # theory: a third of the first-order effect stays in the error; discretisation: the two meshes differ
    assert abs(change - expected) < abs(expected) / 3.0 + MESHES * abs(ratios[1])
    grown, foreseen = forces[0] / forces[1] - 1.0, 1.5 * (lift[1] - lift[0]) / 0.1
    assert abs(grown - foreseen) < 0.15 * abs(foreseen) + 0.006


def test_a_soft_substrate_is_never_a_bar() -> None:
    positions = np.array([[-1.0, 0.0], [1.0, 0.0]])
    for young in (1.0, 10.0):
        problem = pair(0.1, substrate=Elastic(young, 0.48))
        for accuracy in (0.2, 0.06, 0.02):
            extent = choose_extent(problem, positions, (0, 1), [(0.1, 0.05, 0.35)] * 2, accuracy)
            assert extent.margin >= 0.4 * extent.depth
            far = far_field(problem, positions, (0, 1), extent)
            moved, pulls = far.sizes(np.full(2, 0.05))
            # sizes bound the effects whatever cancels
            assert np.all(moved >= np.abs(far.approaches(np.full(2, 0.05))))
            assert np.all(pulls >= np.linalg.norm(far.tangential_forces(np.full(2, 0.05)), axis=1) * (1.0 - 1e-12))


def test_images_are_summed_until_more_of_them_change_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    problem, forces = pair(0.1, substrate=Elastic(1.0, 0.48)), np.full(2, 0.05)
    positions = np.array([[-1.0, 0.0], [1.0, 0.0]])
    few = far_field(problem, positions, (0, 1), Extent(10.0, 25.0)).approaches(forces)
    monkeypatch.setattr("finite_strain.far_field._IMAGES", 14.0)
    monkeypatch.setattr("finite_strain.far_field._MOST", 16)
    many = far_field(problem, positions, (0, 1), Extent(10.0, 25.0)).approaches(forces)
    assert few == relatively(many, 0.01)  # a tenth of the shift stays in the error anyway
