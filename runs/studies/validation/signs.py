"""The sign of the mutual force compared with drops on gels: `linear_bem`, nu = 0.5, R = 1, E1 = 1, D = 0.05."""

import math

from runs.studies.framework.case import LINEAR, Case
from runs.studies.framework.pair import as_seen_by, pair
from runs.studies.framework.saved_cases import Found, pull
from runs.studies.validation.comparison import Comparison, Groups, Point

THICK, THIN = math.inf, 0.5
"""Half-space, and a layer thinner than the balls."""
DISTANCES = {THICK: (2.0, 3.0, 4.0, 8.0), THIN: (2.0, 3.0)}
"""Distances over R. On thick gels the drops attract at all distances; on thin gels the repulsion is of short range."""
EXPECTED = {THICK: 1.0, THIN: -1.0}


def cases() -> list[Case]:
    """Return every pair of balls."""
    return [
        Case(
            f"karpitschka-h{h:g}-L{distance:g}",
            as_seen_by(LINEAR, pair(0.05, h, distance=distance, poisson=0.5, substrate=None)),
            LINEAR, 1e-4, labels={"part": "karpitschka", "h": h, "L": distance},
        )
        for h, distances in DISTANCES.items() for distance in distances
    ]  # fmt: skip


def _points(found: Found) -> Groups:
    """Return the sign of T (1 attracts), with the relative error of T as its error bar, and that of the drops."""
    groups: Groups = {}
    for case in found.done("karpitschka"):
        h, distance = case.labels["h"], case.labels["L"]
        value, bar = pull(found.steps(case.name)[-1]["balls"])
        point = Point(f"L = {distance:g} R", distance, math.copysign(1.0, value), bar / abs(value), EXPECTED[h])
        groups.setdefault("thick" if h == THICK else f"thin, h = {h:g} R", []).append(point)
    return groups


COMPARISONS = (Comparison("karpitschka", "sign of T (1 attracts)", "two balls, D = 0.05 R, nu = 0.5", LINEAR, _points),)
