"""Near pairs and meshes against sums over all pairs: layouts of balls, thin layers, groups far apart."""

import numpy as np
import pytest
from scipy.spatial import cKDTree

from linear_bem import Layer
from linear_bem.errors import NotConverged
from linear_bem.far_field import pairs_and_mesh
from linear_bem.far_field.groups import groupings
from linear_bem.far_field.kernel_split import RULES, Split, reach_of
from linear_bem.far_field.pairs_and_mesh import AROUND, FarField, PointInfluence
from linear_bem.far_field.particle_mesh import ParticleMesh
from linear_bem.layer.kernel import LayeredKernel
from linear_bem.media import Elastic
from linear_bem.touching import near_pairs

BASES = {
    "half-space": (np.inf, None),
    "rigid base": (6.0, None),
    "elastic base": (1.16, Elastic(3.0, 0.3)),
    "thin layer": (0.1, Elastic(3.0, 0.3)),
    "soft base": (0.1, Elastic(0.05, 0.3)),
}


def kernel_of(base):
    thickness, substrate = BASES[base]
    return LayeredKernel(Layer(1.0, 0.48, thickness), substrate)


def square(side=20, pitch=2.5):
    return np.array([(pitch * i, pitch * j) for i in range(side) for j in range(side)])


def ring(count, radius):
    angle = np.linspace(0.0, 2.0 * np.pi, count, endpoint=False)
    return radius * np.stack([np.cos(angle), np.sin(angle)], axis=1)


def layouts():
    rng = np.random.default_rng(3)
    return {
        "uniform": rng.uniform(0.0, 150.0, (3000, 2)),
        "far groups": np.concatenate([square() + 1000.0 * np.array([k % 3, k // 3]) for k in range(6)]),
        "near groups": np.concatenate([square() + 70.0 * np.array([k % 3, k // 3]) for k in range(6)]),
        "row of groups": np.concatenate([square() + np.array([500.0 * k, 0.0]) for k in range(6)]),
        "one stray": np.concatenate([rng.uniform(0.0, 150.0, (3000, 2)), [[1e6, 1e6]]]),
        "far apart": rng.uniform(0.0, 1e5, (3000, 2)),
        "group in a ring": np.concatenate([square() - 25.0, ring(2000, 400.0)]),
    }


@pytest.mark.parametrize("layout", layouts())
@pytest.mark.parametrize("base", BASES)
def test_pairs_and_meshes_add_up_to_the_sum_over_all_pairs(base, layout):
    points, kernel = layouts()[layout], kernel_of(base)
    loads = np.random.default_rng(4).uniform(0.5, 1.0, len(points))
    chosen = np.arange(0, len(points), 40)
    r = np.hypot(*(points[chosen, None] - points).transpose(2, 0, 1))
    r[np.arange(len(chosen)), chosen] = np.inf
    direct = kernel.scaled(r) @ loads
    for precision, error in ((1e-5, 1e-5), (1e-7, 1e-6)):
        field = FarField.of(kernel, points, np.full(len(points), 0.3), precision, 3.0)
        assert field.mesh is not None or (base, layout) == ("rigid base", "far apart")
        found = (PointInfluence(field, points) @ loads)[chosen]
        # a load at the pitch of the balls is the unit: on a rigid base the sum of all nearly cancels
        assert np.max(np.abs(found - direct)) < error * max(np.max(np.abs(direct)), 1.0 / 2.5)
        if field.mesh is not None:
            assert sum(float(np.sum(np.prod(m.doubled.astype(float), axis=1))) for m in field.mesh.meshes) < 3e6


@pytest.mark.parametrize("base", BASES)
@pytest.mark.parametrize("spacing", [0.03, 2.0])
def test_both_parts_and_slopes_of_a_split_belong_together(base, spacing):
    kernel = kernel_of(base)
    split = Split.of(kernel, spacing, RULES[0][1])
    assert split.thin == (spacing > kernel.thickness / 3.0)
    r = split.width * np.geomspace(0.02, 12.0, 60)
    assert split.near(r) + split.far(r) == pytest.approx(kernel.scaled(r), rel=1e-12)
    step = 1e-4 * r
    for value, slope in ((split.near, split.near_slope), (split.far, split.far_slope)):
        rise = (value(r - 2.0 * step) - 8.0 * value(r - step) + 8.0 * value(r + step) - value(r + 2.0 * step)) / (
            12.0 * step
        )
        assert slope(r) == pytest.approx(rise, rel=1e-7, abs=1e-7 * np.max(np.abs(rise)))
    end = split.step + RULES[0][1].cut * split.width
    assert abs(split.near(np.array(end))) < 2e-7 * abs(kernel.scaled(np.array(end))) + 2e-7 / end


def test_groups_are_apart_and_hold_all_balls():
    points = layouts()["far groups"]
    counts = []
    for groups in groupings(points, np.full(len(points), 0.3)):
        counts.append(len(groups.low))
        low, high = groups.low[groups.owners], groups.high[groups.owners]
        assert np.all(points - 0.3 >= low - 1e-9)
        assert np.all(points + 0.3 <= high + 1e-9)
        between = np.maximum(groups.low[:, None] - groups.high, groups.low - groups.high[:, None])
        apart = np.hypot(*np.maximum(between, 0.0).transpose(2, 0, 1))
        assert np.min(apart[~np.eye(counts[-1], dtype=bool)], initial=np.inf) == pytest.approx(groups.gap)
    assert counts[0] == 1
    assert 6 in counts


def test_unlike_pairs_are_those_of_the_direct_search():
    rng = np.random.default_rng(6)
    points, sizes = rng.uniform(0.0, 40.0, (500, 2)), 10.0 ** rng.uniform(-3.0, 0.0, 500)
    sizes[:3] = 0.0
    i, j = np.triu_indices(500, 1)
    apart = np.hypot(*(points[i] - points[j]).T)
    # without a mesh, pairs are left out where the kernel has no range
    field = FarField.of(LayeredKernel(Layer(1.0, 0.3, 0.05)), points, sizes, 1e-8)
    assert field.mesh is None
    kept = apart < reach_of(field.kernel, 1e-9) + AROUND * (sizes[i] + sizes[j])
    assert 0 < np.sum(kept) < len(i) / 2
    pairs = set(zip(field.first.tolist(), field.second.tolist(), strict=True))
    assert pairs == set(zip(i[kept].tolist(), j[kept].tolist(), strict=True))


@pytest.mark.parametrize("cell", [None, np.array([3.0, 5.0])], ids=["plane", "cell"])
@pytest.mark.parametrize("reach", [0.3, 2.4, 20.0])
def test_near_pairs_of_like_and_unlike_reach_are_those_of_the_direct_search(cell, reach):
    rng = np.random.default_rng(0)
    points = rng.uniform(0.0, 3.0, (60, 2))
    i, j = np.triu_indices(60, 1)
    between = points[i] - points[j]
    apart = np.hypot(*(between if cell is None else between - cell * np.round(between / cell)).T)
    for reaches in (np.full(60, reach), rng.uniform(0.1, 1.0, 60) * reach):
        kept = apart <= np.maximum(reaches[i], reaches[j])
        pairs = sorted(map(tuple, near_pairs(points, reaches, cell).tolist()))
        assert pairs == list(zip(i[kept].tolist(), j[kept].tolist(), strict=True))


@pytest.mark.parametrize(("smallest", "within"), [(0.3, 0.1), (0.003, 0.4)], ids=["like", "unlike"])
def test_pairs_of_many_loads_are_counted_from_some(smallest, within):
    rng = np.random.default_rng(2)
    points, sizes, asked = rng.uniform(0.0, 230.0, (6000, 2)), 0.3 * (smallest / 0.3) ** rng.uniform(0.0, 1.0, 6000), []
    choice = pairs_and_mesh._Choice(LayeredKernel(Layer(1.0, 0.3, 3.0)), points, sizes, 1e-5, 0.0)

    class Noted(cKDTree):
        def query_ball_point(self, x, *given, **options):
            asked.append(len(x))
            return super().query_ball_point(x, *given, **options)

    choice.tree = Noted(points)
    assert choice._count(5.0) == pytest.approx(len(choice.near(5.0)[0]), rel=within)
    assert asked == [pairs_and_mesh.COUNTED]


def test_the_meshs_slopes_are_those_of_its_kernel():
    rng = np.random.default_rng(3)
    points, loads = rng.uniform(0.0, 20.0, (200, 2)), rng.uniform(0.5, 1.0, 200)
    mesh = ParticleMesh(points.min(axis=0), points.max(axis=0), 0.5, lambda r: np.exp(-0.5 * r * r))
    at = mesh.at(points[:, 0], points[:, 1], slopes=True)
    field = mesh.field(at, loads)
    d = points[:, None] - points
    value = np.exp(-0.5 * np.sum(d * d, axis=2))
    # the bell has exp(-20) of its waves at pi/H; splines of order 8 leave 1e-6 of those at half of that
    assert at.value @ field == pytest.approx(value @ loads, abs=2e-5)
    exact = -np.einsum("ij,ijk,j->ik", value, d, loads)
    for axis, matrix in enumerate((at.dx, at.dy)):
        assert matrix @ field == pytest.approx(exact[:, axis], abs=6e-5)
    slope = mesh.slope(at, loads)
    assert slope == pytest.approx(exact, abs=3e-5)
    assert np.max(np.abs(loads @ slope)) < 1e-12 * np.max(np.abs(loads @ np.abs(slope)))


def test_points_out_of_the_mesh_are_refused():
    mesh = ParticleMesh(np.zeros(2), np.full(2, 10.0), 1.0, lambda r: np.exp(-r * r))
    mesh.at(np.array([0.0, 10.0]), np.array([10.0, 0.0]))
    for x in (-5.0, 12.0, np.nan):
        with pytest.raises(NotConverged, match="out of the mesh"):
            mesh.at(np.array([5.0, x]), np.array([5.0, 5.0]))


def test_balls_in_a_row_take_the_mesh_too():
    kernel = LayeredKernel(Layer(1.0, 0.48, 1.0), Elastic(100.0, 0.3))
    row = np.stack([3.0 * np.arange(2000), np.zeros(2000)], axis=1)
    assert len(FarField.of(kernel, row, np.array(0.0), 1e-5).first) < 50_000
