"""The gap between a material point and a rigid indenter, as an expression of the form language."""

from __future__ import annotations

from typing import Any

from linear_bem.indenter import Indenter, Paraboloid, Sphere

NAMED = {"sphere": Sphere(1.0), "paraboloid": Paraboloid(1.0)}
"""Indenters of unit radius, which the ball's own radius scales."""


def gap(shape: str | Indenter, radius: Any, offset: Any, displacement: Any, approach: Any, finite: bool) -> Any:
    """Return the gap [m] of points ``offset`` (3,) [m] from the ball's axis at the undeformed surface.

    At finite strain it is the indenter's own distance of the displaced point. At small strain it is the profile over
    the undeformed point minus the vertical displacement: pressure acts vertically, and an in-plane force arises only
    through the profile's slope (the paper's eq. 13).
    """
    indenter, unit = (NAMED[shape], radius) if isinstance(shape, str) else (shape, 1.0)
    if finite:
        x, y, z = ((offset[i] + displacement[i]) / unit for i in range(3))
        return unit * indenter.gap(x, y, z + approach / unit)
    return unit * indenter.height(offset[0] / unit, offset[1] / unit) - approach - displacement[2]
