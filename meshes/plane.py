"""Quadrilaterals in the plane: symmetric blocks under the balls, and a subdivided gmsh mesh between them.

A block is a core with rings about it, from circles to the block's square outline. Every second node of the blocks'
outlines gives a coarse outline; gmsh fills it with triangles and quadrilaterals, which midpoints of edges subdivide
into quadrilaterals that conform to the blocks. `plane_mesh` expects a running gmsh.
"""

import itertools

import gmsh
import numpy as np

from linear_bem.errors import ThirdBodyError, UnsupportedProblem
from meshes.box import SAME, Box, Zone, graded

Interval = tuple[float, float]
WORST, GOOD = 25.0, 35.0
"""Least angle, or 180 less the largest [degrees]: bound for keeping coarse quadrilaterals; sufficient value."""
SWEEPS = 30
"""Rounds in which nodes outside blocks are moved towards the middle of their cells."""
_TURNED = [3, 2, 1, 0, 6, 5, 4, 7, 8]
"""The nodes of a quadrilateral in reverse orientation."""
CLEAR = 0.5
"""Greatest width of elements along a mirror plane over the distance of the next block."""


def plane_mesh(box: Box) -> tuple[np.ndarray, np.ndarray]:
    """Return points (n, 2) [m] and counter-clockwise quadrilaterals (m, 9) that fill the box in the plane.

    A quadrilateral's nodes are its corners, the middles of its sides (the first between the first two corners), and its
    centre; sides in a block are curved like its rings, others are straight.
    """
    curved = np.concatenate([_block(box, zone) for zone in box.zones])
    blocks = quads = curved[:, :4]
    if box.elements % 2:
        quads = np.concatenate([quads, _corners(box)])
        for axis, value in _cutting_sides(box):
            quads = np.concatenate([quads, *_columns(box, quads, axis, value)])
    points, cells = _merged(np.concatenate([quads, _filler(_outlines(box, quads))]))
    free = np.ones(len(points), dtype=bool)
    free[cells[: len(blocks)]] = False
    for axis, value in box.sides:
        free[points[:, axis] == value] = False
    points = _smoothed(points, cells, free)
    if corner_angles(points[cells]).max() >= 180.0:
        raise ThirdBodyError("mesh: a quadrilateral in the plane is not convex")
    straight = points[cells[len(blocks) :]]
    middles, centre = 0.5 * (straight + np.roll(straight, -1, axis=1)), straight.mean(axis=1, keepdims=True)
    return _merged(np.concatenate([curved, np.concatenate([straight, middles, centre], axis=1)]))


def _smoothed(points: np.ndarray, cells: np.ndarray, free: np.ndarray) -> np.ndarray:
    """Return points (n, 2) with the free ones moved towards the middle of their cells as far as angles permit."""

    def worst(places: np.ndarray) -> np.ndarray:
        """Return the least angle, or 180 less the largest [degrees], in the cells about each point."""
        angles, answer = corner_angles(places[cells]), np.full(len(places), 180.0)
        least = np.minimum(angles, 180.0 - angles).min(axis=1)
        np.minimum.at(answer, cells, least[:, None])
        return answer

    best, about = points, np.bincount(cells.ravel())
    for _ in range(SWEEPS):
        target = np.zeros_like(points)
        np.add.at(target, cells, points[cells].mean(axis=1, keepdims=True))
        moved = np.where(free[:, None], 0.5 * (points + target / about[:, None]), points)
        better = worst(moved) >= np.minimum(worst(points), GOOD)
        points = np.where(better[:, None], moved, points)
        if worst(points).min() >= worst(best).min():
            best = points
    return best


def corner_angles(polygons: np.ndarray) -> np.ndarray:
    """Return the inner angles (n, k) [degrees], from 0 to 360, of counter-clockwise polygons (n, k, 2)."""
    after, before = np.roll(polygons, -1, axis=1) - polygons, np.roll(polygons, 1, axis=1) - polygons
    cross = after[..., 0] * before[..., 1] - after[..., 1] * before[..., 0]
    return np.degrees(np.arctan2(cross, np.sum(after * before, axis=-1))) % 360.0


def _block(box: Box, zone: Zone) -> np.ndarray:
    """Return the nodes (n, 9, 2) of a block's quadrilaterals: mirror images of one quadrant."""
    n = 2 * box.elements
    radii, squareness = map(halved, box.rings(zone))
    side = np.arange(n + 1) / n
    u, v = np.meshgrid(side, side, indexing="ij")
    along, across = np.maximum(u, v), np.minimum(u, v)
    angle = 0.25 * np.pi * np.divide(across, along, out=np.zeros_like(u), where=along > 0.0)
    far, near = along * np.cos(angle), along * np.sin(angle)
    circle = np.stack([np.where(u >= v, far, near), np.where(u >= v, near, far)], axis=-1)
    square = np.stack([u, v], axis=-1)
    blend = (squareness[0] + (1.0 - squareness[0]) * (1.0 - along))[..., None]
    core = radii[0] * (blend * square + (1.0 - blend) * circle)
    rim = np.concatenate([np.stack([circle, square])[:, n, :], np.stack([circle, square])[:, n - 1 :: -1, n]], axis=1)
    beta = squareness[:, None, None]
    rings = radii[:, None, None] * (beta * rim[1] + (1.0 - beta) * rim[0])
    quadrant = np.concatenate([_curved_cells(core), _curved_cells(rings)])
    images = []
    for sx, sy in box.quadrants(zone):
        image = quadrant * np.array([sx, sy]) + np.array(zone.position)
        images.append(image if sx * sy > 0 else image[:, _TURNED])
    quads = np.concatenate(images)
    for axis, end in box.sides:  # a block reaches its mirror plane exactly
        on = np.abs(quads[..., axis] - end) < SAME * zone.half_width
        quads[..., axis][on] = end
    return quads


def _curved_cells(grid: np.ndarray) -> np.ndarray:
    """Return the nodes (n, 9, 2) of the quadrilaterals whose corners are every second node (i, j, 2) of a grid."""
    low, high = slice(0, -1, 2), slice(2, None, 2)
    middle = slice(1, None, 2)
    ring = [(low, low), (high, low), (high, high), (low, high)]
    ring += [(middle, low), (high, middle), (middle, high), (low, middle), (middle, middle)]
    return np.stack([grid[i, j] for i, j in ring], axis=2).reshape(-1, 9, 2)


def _merged(quads: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Merge equal corners of polygons (n, k, 2) to numbered points."""
    flat = quads.reshape(-1, 2)
    corners = quads[:, :4]
    tolerance = 1e-6 * np.sqrt(np.min(np.sum((corners - np.roll(corners, 1, axis=1)) ** 2, axis=-1)))
    number = np.zeros(len(flat), dtype=np.int64)
    for axis in (0, 1):  # number the distinct coordinates: those closer than the tolerance are one
        order = np.argsort(flat[:, axis], kind="stable")
        rank = np.concatenate([[0], np.cumsum(np.diff(flat[order, axis]) > tolerance)])
        number[order] = number[order] * len(flat) + rank
    _, first, inverse = np.unique(number, return_index=True, return_inverse=True)
    return flat[first], inverse.reshape(quads.shape[:2])


def open_edges(cells: np.ndarray) -> np.ndarray:
    """Return the directed edges (n, 2) of polygons that have no neighbour (no reversed edge)."""
    edges = np.stack([cells, np.roll(cells, -1, axis=1)], axis=-1).reshape(-1, 2)
    known = set(map(tuple, edges.tolist()))
    return np.array([edge for edge in edges.tolist() if (edge[1], edge[0]) not in known])


def _cutting_sides(box: Box) -> list[tuple[int, float]]:
    """Return the sides (axis, value) of the box that cut a block in half."""
    return [
        (axis, value)
        for axis, value in box.sides
        if any(abs(zone.position[axis] - value) < SAME * zone.half_width for zone in box.zones)
    ]


def _gaps(box: Box, quads: np.ndarray, axis: int, value: float) -> list[Interval]:
    """Return the intervals of a side of the box that no quadrilateral touches."""
    after = np.roll(quads, -1, axis=1)
    on = (quads[..., axis] == value) & (after[..., axis] == value)
    spans = np.sort(np.stack([quads[on][:, 1 - axis], after[on][:, 1 - axis]], axis=1), axis=1)
    spans = spans[np.argsort(spans[:, 0])]
    low, high = (box.y, box.x)[axis]
    starts, ends = [low, *spans[:, 1].tolist()], [*spans[:, 0].tolist(), high]
    return [(s, e) for s, e in zip(starts, ends, strict=True) if e - s > SAME * (high - low)]


def _corners(box: Box) -> np.ndarray:
    """Return the squares (n, 4, 2) in which columns along two sides of the box cross."""
    cut = _cutting_sides(box)
    squares = []
    for x, y in itertools.product(box.x, box.y):
        corner = np.array([x, y])
        free = min(box.beyond(zone, corner) for zone in box.zones)
        if (0, x) in cut and (1, y) in cut and free > 0.0:
            side = min(float(box.size(corner)), CLEAR * free)
            opposite = corner + side * np.where(corner == [box.x[0], box.y[0]], 1.0, -1.0)
            low, high = np.minimum(corner, opposite), np.maximum(corner, opposite)
            squares.append([low, [high[0], low[1]], high, [low[0], high[1]]])
    return np.array(squares).reshape(-1, 4, 2)


def _columns(box: Box, quads: np.ndarray, axis: int, value: float) -> list[np.ndarray]:
    """Return a column of quadrilaterals (n, 4, 2) along each gap of a side that cuts blocks in half.

    A half block has n segments beside the plane. If n is odd, elements along the plane use one of them, as if the
    plane also cut elements of gmsh's coarse mesh in half; the coarse mesh then meets an even number of segments.
    """
    inward = 1.0 if value == (box.x, box.y)[axis][0] else -1.0
    columns = []
    for low, high in _gaps(box, quads, axis, value):
        within = 0.5 * (high - low) * (1.0 - SAME)
        aside = [z for z in box.zones if abs(z.position[1 - axis] - 0.5 * (low + high)) < within + z.half_width]
        along, width = _graded_side(box, axis, value, (low, high), aside)
        for end in (0, -1):  # at its ends the column continues a segment of its neighbour
            offset = inward * (quads[..., axis] - value)
            met = offset[(offset > 0.0) & (np.abs(quads[..., 1 - axis] - along[end]) < SAME * (high - low))]
            width[end] = met.min() if met.size else width[end]
        along, width = halved(along), halved(width)
        near, far = _on_side(axis, value, along), _on_side(axis, value + inward * width, along)
        cells = np.stack([near[:-1], far[:-1], far[1:], near[1:]], axis=1)
        columns.append(cells if corner_angles(cells).max() < 180.0 else cells[:, ::-1])
    return columns


def _on_side(axis: int, value: float | np.ndarray, along: np.ndarray) -> np.ndarray:
    """Return points (n, 2) with coordinate ``value`` along ``axis`` and ``along`` (n,) as the other coordinate."""
    return np.stack([np.full(along.shape, value), along][:: 1 - 2 * axis], axis=-1)


def _graded_side(box: Box, axis: int, value: float, gap: Interval, aside: list[Zone]) -> tuple[np.ndarray, np.ndarray]:
    """Return coarse nodes along a gap, two elements apart, and the width of elements there between ``aside`` blocks."""

    def width(along: np.ndarray) -> np.ndarray:
        points = _on_side(axis, value, along)
        return np.min([box.size(points), *[CLEAR * box.beyond(zone, points) for zone in aside]], axis=0)

    def length(along: np.ndarray) -> np.ndarray:
        return 2.0 * np.minimum(box.size(_on_side(axis, value, along)), 2.0 * width(along))

    along = graded(*gap, length)
    return along, width(along)


def halved(coarse: np.ndarray) -> np.ndarray:
    """Return the values with the means of neighbours inserted between them."""
    return np.interp(np.arange(2 * len(coarse) - 1) / 2.0, np.arange(len(coarse)), coarse)


def _outlines(box: Box, quads: np.ndarray) -> list[np.ndarray]:
    """Return closed loops (k, 2) of coarse nodes around the regions without quadrilaterals, which lie on their left.

    Each is half as fine as the edges that it meets, so that its segments conform after subdivision.
    """
    points, cells = _merged(quads)
    pieces = [points[open_edges(cells)[:, ::-1]]]
    for axis, value in box.sides:
        pieces[0] = pieces[0][np.any(pieces[0][..., axis] != value, axis=1)]
    for axis, value in box.sides:
        for gap in _gaps(box, quads, axis, value):
            nodes = _on_side(axis, value, halved(_graded_side(box, axis, value, gap, [])[0]))
            forward = (axis == 0) == (value == (box.x, box.y)[axis][1])
            nodes = nodes if forward else nodes[::-1]
            pieces.append(np.stack([nodes[:-1], nodes[1:]], axis=1))
    points, edges = _merged(np.concatenate(pieces))
    following = dict(edges.tolist())
    loops = []
    while following:
        loop = [next(iter(following))]
        while (node := following.pop(loop[-1])) != loop[0]:
            loop.append(node)
        nodes = points[loop]
        bent = np.flatnonzero(np.abs(corner_angles(nodes[None])[0] - 180.0) > 1e-3)
        if len(loop) % 2 or np.any((bent - bent[0]) % 2):
            raise ThirdBodyError("mesh: an odd number of segments lies between two corners of the blocks' outline")
        loops.append(np.roll(nodes, -bent[0], axis=0)[::2])
    if loops and _cross(np.concatenate([np.stack([loop, np.roll(loop, -1, axis=0)]) for loop in loops], axis=1)):
        rule = "numerics.growth: elements must not grow so fast that their edges cross between blocks and sides"
        raise UnsupportedProblem(f"{rule}, got {box.growth:g}; give less")
    return loops


def _cross(ends: np.ndarray) -> bool:
    """Return whether segments between ``ends`` (2, n, 2) cross, which gmsh may answer by ending the process."""
    along, to_ends = (part / np.ptp(ends) for part in (ends[1] - ends[0], ends[:, None] - ends[0][:, None]))
    beside = along[:, None, 0] * to_ends[..., 1] - along[:, None, 1] * to_ends[..., 0]
    apart = (beside[0] * beside[1] < 0.0) & (np.abs(beside).min(axis=0) > 1e-9)
    return bool(np.any(apart & apart.T))


def _filler(loops: list[np.ndarray]) -> np.ndarray:
    """Return the corners (n, 4, 2) of quadrilaterals that fill the loops: the best gmsh mesh, subdivided."""
    geometry = gmsh.model.geo
    curves, areas = [], []
    for loop in loops:
        nodes = [geometry.addPoint(x, y, 0.0) for x, y in loop.tolist()]
        lines = [geometry.addLine(a, b) for a, b in zip(nodes, nodes[1:] + nodes[:1], strict=True)]
        for line in lines:
            geometry.mesh.setTransfiniteCurve(line, 2)
        curves.append(geometry.addCurveLoop(lines))
        after = np.roll(loop, -1, axis=0)
        areas.append(float(np.sum(loop[:, 0] * after[:, 1] - loop[:, 1] * after[:, 0])))
    for curve, loop, area in zip(curves, loops, areas, strict=True):
        if area > 0.0:
            holes = [c for c, hole, a in zip(curves, loops, areas, strict=True) if a < 0.0 and _encloses(loop, hole[0])]
            geometry.addPlaneSurface([curve, *holes])
    geometry.synchronize()
    gmsh.option.setNumber("Mesh.RecombineAll", 1)
    gmsh.option.setNumber("Mesh.RandomSeed", 1)
    found = []
    for algorithm, recombination in itertools.product((5, 6), (0, 1)):
        gmsh.option.setNumber("Mesh.Algorithm", algorithm)
        gmsh.option.setNumber("Mesh.RecombinationAlgorithm", recombination)
        gmsh.model.mesh.clear()
        gmsh.model.mesh.generate(2)
        quads = _subdivided(_coarse_cells(3), _coarse_cells(2))
        angles = corner_angles(quads)
        found.append((min(angles.min(), 180.0 - angles.max(), GOOD), -len(quads), quads))
    return max(found, key=lambda candidate: candidate[:2])[2]


def _encloses(loop: np.ndarray, point: np.ndarray) -> bool:
    ray = (loop - point) @ np.array([1.0, 1j])
    return bool(abs(np.sum(np.angle(np.roll(ray, -1) / ray))) > 1.0)


def _coarse_cells(kind: int) -> np.ndarray:
    """Return the corners (n, k, 2) of gmsh's triangles (2) or quadrilaterals (3), counter-clockwise."""
    tags, coordinates, _ = gmsh.model.mesh.getNodes()
    place = np.zeros((int(tags.max()) + 1, 2))
    place[tags.astype(np.int64)] = coordinates.reshape(-1, 3)[:, :2]
    _, nodes = gmsh.model.mesh.getElementsByType(kind)
    return place[nodes.astype(np.int64)].reshape(-1, kind + 1, 2)


def _subdivided(quads: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """Return four quadrilaterals for each (k, 4, 2) and three for each triangle (k, 3, 2), by midpoints of edges."""
    angles = corner_angles(quads)
    slender = np.any((angles < WORST) | (angles > 180.0 - WORST), axis=1)
    for quad, angle in zip(quads[slender], angles[slender], strict=True):  # cut at its widest angle
        turned = np.roll(quad, -int(np.argmax(angle)), axis=0)
        triangles = np.concatenate([triangles, turned[None, [0, 1, 2]], turned[None, [0, 2, 3]]])
    parts = []
    for cells in (quads[~slender], triangles):
        middles = 0.5 * (cells + np.roll(cells, -1, axis=1))
        centre = np.broadcast_to(cells.mean(axis=1, keepdims=True), cells.shape)
        parts.append(np.stack([cells, middles, centre, np.roll(middles, 1, axis=1)], axis=2).reshape(-1, 4, 2))
    return np.concatenate(parts)
