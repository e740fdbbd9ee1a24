"""Physical groups of a user's mesh file: identified by name or number, checked to be disjoint."""

from collections import Counter
from itertools import chain
from pathlib import Path

import gmsh

from linear_bem.errors import InvalidProblem
from meshes.box import TAGS


def number_groups(file: Path) -> None:
    """Renumber the physical groups of gmsh's model whose names are in `TAGS` accordingly.

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
        names = [model.getPhysicalName(dimension, tag) for tag in tags]
        found += list(zip([dimension] * len(tags), tags, names, parts, strict=True))
    if all(TAGS.get(name, tag) == tag for _, tag, name, _ in found):
        return
    model.removePhysicalGroups()
    other = 1 + max(*TAGS.values(), *(tag for _, tag, _, _ in found))
    for number, (dimension, _, name, part) in enumerate(found):
        model.addPhysicalGroup(dimension, part, TAGS.get(name, other + number))
