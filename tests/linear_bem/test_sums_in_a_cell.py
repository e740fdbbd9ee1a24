"""Sums over the images of a cell that repeats: by pairs and a mesh, and the wave k = 0."""

import itertools

import numpy as np
import pytest

from linear_bem import Ball, Elastic, Layer, LayeredKernel, Load, Periodic, Problem, SurfaceResponse
from linear_bem.far_field.kernel_split import RULES, Split
from linear_bem.far_field.pairs_and_mesh import FarField, PointInfluence
from linear_bem.far_field.particle_mesh import NestedMesh, PeriodicMesh
from linear_bem.layer.cell import Cell
from linear_bem.layer.response import LayerResponse

LAYER, LENGTHS = Layer(1.0, 0.4, 1.5), (4.6, 4.4)


def kernel_in_cell():
    ball, load = Ball((0.0, 0.0), 1.0), Load("force", (0.1,))
    return LayeredKernel.of(Problem(LAYER, (ball,), load, periodic=Periodic(LENGTHS)))


def test_the_mesh_and_near_images_add_up_to_the_sum_over_all_images():
    rng = np.random.default_rng(4)
    points, loads = rng.uniform(-4.0, 9.0, (30, 2)), rng.uniform(0.5, 1.5, 30)
    kernel = kernel_in_cell()
    exact = np.zeros(30)
    for m in range(-8, 9):
        for n in range(-8, 9):
            r = np.hypot(*np.moveaxis(points[:, None] - points - np.multiply((m, n), LENGTHS), 2, 0))
            exact += np.where(r > 0.0, kernel.scaled(np.where(r > 0.0, r, 1.0)), 0.0) @ loads
    found = []
    for precision, error in ((1e-5, 4e-6), (1e-7, 3e-7), (1e-10, 1e-8)):
        field = FarField.of(kernel, points, np.array(0.0), precision)
        assert field.mesh is not None
        found.append(PointInfluence(field, points) @ loads)
        assert np.max(np.abs(found[-1] - exact)) < error * np.max(np.abs(exact))


@pytest.mark.parametrize("base", [None, Elastic(5.0, 0.3)])
def test_meshes_coarser_than_a_thin_layer_add_up_to_the_kernel(base):
    rng = np.random.default_rng(7)
    lengths = (20.0, 21.0)
    points, loads = rng.uniform(0.0, 20.0, (400, 2)), rng.uniform(0.5, 1.5, 400)
    ball = Ball((0.0, 0.0), 1.0)
    kernel = LayeredKernel.of(
        Problem(Layer(1.0, 0.45, 0.1), (ball,), Load("force", (1.0,)), base, periodic=Periodic(lengths))
    )
    found = []
    for spacing in (0.25, 0.5):
        rule = RULES[0][1]
        split = Split.of(kernel, spacing, rule)
        assert split.thin
        cut = split.step + rule.cut * split.width
        mesh = PeriodicMesh(
            np.array(lengths), spacing, lambda k, s=split, c=cut: s.far_transform(k, c, kernel.cell.uniform)
        )
        field = FarField(kernel, *kernel.cell.pairs(points, cut), NestedMesh((mesh,)), split, cut)
        found.append(PointInfluence(field, points) @ loads)
    if base is None:  # where the sum over images converges
        exact = np.zeros(400)
        for m, n in itertools.product((-1, 0, 1), repeat=2):
            r = np.hypot(*np.moveaxis(points[:, None] - points - np.multiply((m, n), lengths), 2, 0))
            exact += np.where(r > 0.0, kernel.scaled(np.where(r > 0.0, r, 1.0)), 0.0) @ loads
        found.append(exact)
    for other in found[1:]:
        assert np.max(np.abs(found[0] - other)) < 2e-6 * np.max(np.abs(other))


@pytest.mark.parametrize("reach", [1.0, 6.0, 14.0])
def test_pairs_in_a_cell_are_all_images_within_reach_once(reach):
    points = np.random.default_rng(5).uniform(-8.0, 12.0, (12, 2))
    first, second, shift = Cell(np.array(LENGTHS), 0.0).pairs(points, reach)
    vectors = points[first] - points[second] - shift
    found = np.concatenate([np.column_stack([first, second, vectors]), np.column_stack([second, first, -vectors])])
    wanted = []
    for m in range(-12, 13):
        for n in range(-12, 13):
            apart = points[:, None] - points - np.multiply((m, n), LENGTHS)
            r = np.hypot(apart[..., 0], apart[..., 1])
            i, j = np.nonzero((r <= reach) & (r > 0.0))
            wanted.append(np.column_stack([i, j, apart[i, j]]))
    wanted = np.concatenate(wanted)

    def ordered(rows):
        return rows[np.lexsort(np.round(rows, 6).T)]

    assert found.shape == wanted.shape
    np.testing.assert_allclose(ordered(found), ordered(wanted), atol=1e-12)


def test_a_uniform_pressure_compresses_the_layer_alone():
    # a rigid base: the closed form is the limit of the response; a stiff base tends to it, a half-space has none
    closed, measured = (kernel_in_cell() for _ in range(2))
    assert closed.cell.uniform == pytest.approx(measured.uniform, rel=1e-9)
    response = LayerResponse(Elastic(1.0, 0.4), None)
    own = SurfaceResponse(1.0, 0.4, LAYER.thickness, response)
    periodic = Cell.of(LENGTHS, own, LayeredKernel(own))
    assert periodic.uniform == pytest.approx(closed.cell.uniform, rel=1e-5)
    half_space = Layer(1.0, 0.4, np.inf)
    assert Cell.of(LENGTHS, half_space, LayeredKernel(half_space)).uniform == 0.0
