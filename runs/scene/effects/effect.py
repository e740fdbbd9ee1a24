"""An effect of a scene file: an optional table with its description."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from runs.scene.units import Table


@dataclass(frozen=True)
class Effect:
    """One entry of the registry.

    ``words`` and ``without`` describe the simulation with and without the table; ``example`` holds a valid value of
    every key. ``part`` converts the table to the problem's field of the same name (None: no model uses the effect);
    ``faults`` returns the faults of the table in a scene, one text each. An effect ``of_drift`` belongs to the motion
    of the balls: ``evolve`` applies it; a model does so only if it lists the effect and no ball moves.
    """

    name: str
    table: type[Table]
    words: str
    without: str
    example: Mapping[str, Any]
    part: Callable[[Any], Any] | None = None
    faults: Callable[[Any, Any], list[str]] = lambda _table, _scene: []
    of_drift: bool = False
