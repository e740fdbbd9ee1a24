"""Physical groups of a user's mesh file: identified by name or number, checked to be disjoint and on cells."""

from collections import Counter
from collections.abc import Sequence
from itertools import chain
from pathlib import Path

import gmsh
import numpy as np

from linear_bem.errors import InvalidProblem
from meshes.box import TAGS

CELLS = (4, 5, 11, 12, 29)
"""gmsh's numbers of the cells that DOLFINx reads: tetrahedra of orders 1, 2 and 3, hexahedra of orders 1 and 2."""


def number_groups(file: Path) -> None:
    """Renumber the physical groups of gmsh's model whose names, in any case, are in `TAGS` accordingly.

    Raises `InvalidProblem`, which names the ``file``.
    """
    model, found = gmsh.model, []
    for dimension, what in ((3, "volumes"), (2, "faces")):
        tags = [tag for _, tag in model.getPhysicalGroups(dimension)]
        if not tags:
            asked = "layer and, if there is one, substrate" if dimension == 3 else "top and bottom"
            raise InvalidProblem(f"mesh: {file} has no physical groups of {what}; add groups with the names {asked}")
        parts = [model.getEntitiesForPhysicalGroup(dimension, tag).tolist() for tag in tags]
        twice = [part for part, count in Counter(chain(*parts)).items() if count > 1]
        if twice:
            raise InvalidProblem(f"mesh: {file}: {what} {twice} are in two physical groups; put each into one")
        names = [model.getPhysicalName(dimension, tag).strip().lower() for tag in tags]
        found += list(zip([dimension] * len(tags), tags, names, parts, strict=True))
    _require_cells(file, found)
    if all(TAGS.get(name, tag) == tag for _, tag, name, _ in found):
        return
    model.removePhysicalGroups()
    other = 1 + max(*TAGS.values(), *(tag for _, tag, _, _ in found))
    joined: dict[tuple[int, int], list[int]] = {}  # the parts of "Top" and "top"
    for number, (dimension, _, name, part) in enumerate(found):
        joined.setdefault((dimension, TAGS.get(name, other + number)), []).extend(part)
    for (dimension, tag), part in joined.items():
        model.addPhysicalGroup(dimension, part, tag)


def _require_cells(file: Path, groups: Sequence[tuple[int, int, str, list[int]]]) -> None:
    """Raise `InvalidProblem` for a group of faces beside which no cell is in a group; DOLFINx would crash."""
    nodes = {(dim, tag): gmsh.model.mesh.getNodesForPhysicalGroup(dim, tag)[0] for dim, tag, *_ in groups}
    of_cells = np.concatenate([found for (dim, _), found in nodes.items() if dim == 3])
    if not len(of_cells):
        raise InvalidProblem(f"mesh: {file}: its volumes have no cells; mesh them by gmsh.model.mesh.generate(3)")
    parts = chain(*(parts for dim, _, _, parts in groups if dim == 3))
    kinds = sorted({kind for part in parts for kind in gmsh.model.mesh.getElementTypes(3, part)})
    if len(kinds) > 1 or kinds[0] not in CELLS:
        names = " and ".join(gmsh.model.mesh.getElementProperties(kind)[0] for kind in kinds)
        raise InvalidProblem(
            f"mesh: {file}: cells must be either hexahedra of 8 or 27 nodes or tetrahedra of 4 or 10, got {names}; for "
            "hexahedra alone recombine all faces to quadrilaterals before extruding them, of order 1 or of order 2 "
            "with Mesh.SecondOrderIncomplete = 0"
        )
    for dim, tag, name, _ in groups:
        if dim == 2 and not np.isin(nodes[dim, tag], of_cells).all():
            raise InvalidProblem(
                f"mesh: {file}: faces of the group {name or tag} belong to no volume that is in a group; put every "
                "volume into one, layer or substrate"
            )
