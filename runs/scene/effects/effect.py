"""An effect as a scene file has it: an optional table with its description."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from runs.scene.units import Table


@dataclass(frozen=True)
class Effect:
    """One entry of the registry.

    ``words`` and ``without`` say what is simulated with the table and without it; ``example`` holds a valid value of
    every key. ``part`` makes the value of the problem's field of the same name from the table (None: the effect is not
    a model's); ``faults`` returns what is wrong with the table in a scene, one text each. An effect
    ``of_drift`` concerns how balls move: ``evolve`` has it, and a model only where it names it and no ball moves.
    """

    name: str
    table: type[Table]
    words: str
    without: str
    example: Mapping[str, Any]
    part: Callable[[Any], Any] | None = None
    faults: Callable[[Any, Any], list[str]] = lambda _table, _scene: []
    of_drift: bool = False
