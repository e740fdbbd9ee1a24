"""Mesh parameters set before gmsh: half-widths of blocks, rings, levels and the number of elements."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest

from meshes.box import CAP, GROWTH, OUTSIDE, SHARED_CAP, STRIP, Box, graded, half_widths
from tests.meshes.conftest import SCENES, box_of

ROUNDOFF = 1e-12
WIDE = (-50.0, 50.0)


def test_a_lone_ball_gets_a_block_of_some_contact_radii_but_not_up_to_the_box() -> None:
    assert half_widths([(0.0, 0.0)], [0.4], WIDE, WIDE) == pytest.approx([CAP * 0.4])
    assert half_widths([(0.0, 0.0)], [0.4], (-1.0, 9.0), WIDE) == pytest.approx([OUTSIDE * 1.0])
    assert half_widths([(0.0, 0.0)], [0.4], (0.0, 9.0), (0.0, 9.0), (0, 1)) == pytest.approx([CAP * 0.4])


def test_a_touching_pair_shares_the_face_half_way_with_and_without_its_mirror_plane() -> None:
    whole = half_widths([(-1.0, 0.0), (1.0, 0.0)], [0.3, 0.3], WIDE, WIDE)
    half = half_widths([(1.0, 0.0)], [0.3], (0.0, 9.0), WIDE, (0,))
    quarter = half_widths([(1.0, 0.0)], [0.3], (0.0, 9.0), (0.0, 9.0), (0, 1))
    assert [*whole, *half, *quarter] == [1.0] * 4


def test_a_pair_too_far_apart_for_its_contacts_shares_no_face() -> None:
    distance = 2.1 * SHARED_CAP * 0.3
    assert half_widths([(0.0, 0.0), (distance, 0.0)], [0.3, 0.3], WIDE, WIDE) == pytest.approx([CAP * 0.3] * 2)


def test_contacts_that_merge_get_blocks_smaller_than_themselves() -> None:
    assert half_widths([(-0.5, 0.0), (0.5, 0.0)], [0.7, 0.7], WIDE, WIDE) == [0.5, 0.5]


def test_unlike_balls_share_the_room_between_them_by_their_contacts() -> None:
    small, large = half_widths([(-0.5, 0.0), (0.5, 0.2)], [0.2, 0.8], WIDE, WIDE)
    assert large / small == pytest.approx(4.0)
    assert small + large == pytest.approx(1.0 - STRIP)


def test_a_grid_shares_all_faces_and_a_displaced_ball_leaves_strips() -> None:
    grid = [(2.0 * i, 2.0 * j) for i in range(3) for j in range(3)]
    assert half_widths(grid, [0.4] * 9, WIDE, WIDE) == [1.0] * 9
    assert half_widths([(0.0, 0.0), (2.0, 0.0), (2.0, 2.0), (0.0, 2.0)][:3:2], [0.4] * 2, WIDE, WIDE) == pytest.approx(
        [1.0 - STRIP] * 2  # no third block between two that would meet at a corner
    )
    moved = half_widths([*grid[:8], (4.0, 4.1)], [0.4] * 9, WIDE, WIDE)
    assert moved[8] < 1.0


def test_a_block_does_not_reach_a_mirror_plane_that_cuts_another() -> None:
    beside, cut = half_widths([(1.0, 0.0), (0.0, 5.0)], [0.4, 0.4], (0.0, 9.0), WIDE, (0,))
    assert (beside, cut) == pytest.approx((1.0 - STRIP, 1.2))


def mirrored(box: Box) -> list[tuple[np.ndarray, float]]:
    """Return positions and half-widths of all blocks, those mirrored about x = 0 and y = 0 where the box ends there."""
    blocks = [(np.array(zone.position), zone.half_width) for zone in box.zones]
    for axis, side in enumerate((box.x, box.y)):
        if side[0] == 0.0:
            flip = np.where(np.arange(2) == axis, -1.0, 1.0)
            blocks += [(centre * flip, width) for centre, width in blocks if centre[axis] != 0.0]
    return blocks


@pytest.mark.parametrize("name", list(SCENES))
def test_blocks_share_faces_or_corners_exactly_or_leave_a_strip_that_is_no_sliver(name: str) -> None:
    for (a, m), (b, k) in combinations(mirrored(SCENES[name](1)), 2):
        offset = np.abs(a - b)
        strip = offset.max() - m - k
        if strip < ROUNDOFF:  # then the whole face, or a corner of equal blocks
            assert strip == pytest.approx(0.0, abs=ROUNDOFF)
            assert m == pytest.approx(k, abs=ROUNDOFF)
            assert offset.min() == pytest.approx(0.0, abs=ROUNDOFF) or np.ptp(offset) < ROUNDOFF
        else:
            assert strip > 0.4 * min(m, k)


@pytest.mark.parametrize("elements", [1, 2, 3, 5])
@pytest.mark.parametrize("name", ["one ball", "touching pair on a substrate, quarter", "unlike pair, half"])
def test_rings_grow_at_most_by_the_stated_factor_and_one_lies_at_the_contact_edge(name: str, elements: int) -> None:
    box = SCENES[name](elements)
    for zone in box.zones:
        radii, squareness = box.rings(zone)
        # the steps that `graded` takes may be 5 % longer than asked
        assert np.max(radii[1:] / radii[:-1]) <= (1.0 + GROWTH / elements) ** 1.06
        assert zone.contact_radius in radii
        assert radii[-1] == zone.half_width
        assert squareness[[*(radii == zone.contact_radius)].index(True)] == 0.0
        assert squareness[-1] == 1.0
        assert 0.4 <= radii[0] / zone.contact_radius <= 0.65


def test_on_a_film_rings_at_the_contact_edge_are_as_wide_as_the_film_is_thick() -> None:
    box = SCENES["touching pair on a film, quarter"](1)
    (zone,) = box.zones
    radii, _ = box.rings(zone)
    edge = [*radii].index(zone.contact_radius)
    widths = np.diff(radii)[edge - 1 : edge + 1]
    assert widths == pytest.approx(box.thickness, rel=1.0)
    assert np.diff(radii).max() > 3.0 * widths.max()


@pytest.mark.parametrize("elements", [1, 2, 3])
def test_levels_begin_fine_and_grow_downwards_through_layer_and_substrate(elements: int) -> None:
    box = SCENES["touching pair on a substrate, quarter"](elements)
    layer, substrate = box.levels()
    assert (layer[0], layer[-1], substrate[-1]) == (0.0, -box.thickness, -box.thickness - box.substrate)
    assert substrate[0] == layer[-1]
    assert min(len(layer), len(substrate)) >= elements + 2
    assert 0.3 <= (layer[0] - layer[1]) * elements / box.zones[0].contact_radius <= 0.9
    for levels in (layer, substrate):
        steps = -np.diff(levels)
        assert np.all(steps[1:] / steps[:-1] <= (1.0 + GROWTH / elements) ** 1.06)
        assert np.all(steps[1:] > steps[:-1])
    assert len(replace(box, substrate=0.0).levels()[1]) == 0


def test_graded_steps_have_the_requested_mean_length() -> None:
    nodes = graded(0.0, 4.0, lambda x: 0.5 + 0.0 * x)
    assert nodes == pytest.approx(np.linspace(0.0, 4.0, 9))
    assert len(graded(0.0, 1.0, lambda x: 9.0 + x, least=3)) == 4


def test_other_units_scale_every_length_and_nothing_else() -> None:
    box = box_of([(1.0, 0.0)], 0.4, 2, (0, 1), substrate=3.0)
    box = replace(box, zones=tuple(replace(zone, detail=0.04) for zone in box.zones))
    scaled = box.in_units_of(1e-3)
    assert scaled.in_units_of(1e3) == box
    assert scaled.elements == box.elements
    assert scaled.estimated_hexahedra() == pytest.approx(box.estimated_hexahedra())
    assert [len(part) for part in scaled.levels()] == [len(part) for part in box.levels()]
    assert scaled.coarsest == pytest.approx(1e3 * box.coarsest)


def test_elements_outside_the_blocks_grow_from_the_outline_to_the_coarsest() -> None:
    box = SCENES["one ball"](2)
    (zone,) = box.zones
    sizes = box.size(np.array([[zone.half_width, 0.0], [2.0, 0.0], [0.0, -2.0], [4.0, 4.0]]))
    assert sizes[0] == pytest.approx(zone.half_width / 2)
    assert sizes[1] == sizes[2] == pytest.approx(zone.half_width / 2 + math.log(1.3) * (2.0 - zone.half_width))
    assert sizes[3] <= box.coarsest
