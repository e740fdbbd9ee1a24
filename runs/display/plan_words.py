"""The numbers of a plan in words: names of its keys, times, memories, domain."""

from collections.abc import Callable, Mapping
from typing import Any

from linear_bem.counts import grouped
from runs.display.numbers import duration, number
from runs.models import ONE, TWO
from runs.process.machine import memory_bytes
from runs.scene.units import Unit

NAMES = {
    "forms": "form of the elements",
    "linear_solver": "linear solver of the finest mesh planned",
    "memory_bytes": "memory",
    "processor_memory_bytes": "memory on one core",
    "memory_bytes_at_most": "memory of the finest mesh that the budget allows",
    "seconds": f"time on {TWO}",
    "processor_seconds": f"time on {ONE}",
    "symmetries": "symmetries used",
    "meshes": "meshes",
    "accuracy": "refined until",
    "compare": "in compare",
    "perhaps": "or perhaps",
    "refused": "refused:",
    "load_steps": "load steps",
    "states": "states solved",
}


def name(key: str, model: Mapping[str, Any]) -> str:
    """Return what a key of a model's plan is called; a model without finite elements runs on one core."""
    alone = key == "seconds" and "processor_seconds" not in model
    return "time on one idle core" if alone else NAMES.get(key, key.replace("_", " "))


def domain(sides: Mapping[str, Any], unit: Unit) -> str:
    """Return the sides [m] of the meshed domain in a unit."""
    shown = {k: [x / unit.size for x in v] if isinstance(v, list) else v / unit.size for k, v in sides.items()}
    return f"{unit.heading('domain')}: {word('', shown)}"


def _goal(accuracy: Mapping[str, Any]) -> str:
    seconds = accuracy["seconds_at_most"]
    limit = "no time limit" if seconds is None else f"at most {duration(float(seconds))}"
    known = f"T is known to {100 * accuracy['asked']:.3g} %"
    return f"{known}; at most {grouped(accuracy['unknowns_at_most'])} unknowns; {limit}"


def _about(seconds: float) -> str:
    return f"about {duration(float(seconds))}"


def memory_words(value: float) -> str:
    """Return a memory [bytes] in words; more than the machine has is said."""
    if value <= 5e7:
        return f"about {max(value / 1e6, 1.0):.0f} MB"
    here = memory_bytes()
    said = f"about {value / 1e9:.2g} GB" if value < 1e11 else f"about {value / 1e9:.0f} GB"
    return said if value < here else f"{said}, more than the {here / 1e9:.0f} GB of this machine"


def word(key: str, value: Any) -> str:
    """Return the value of a key of a plan in words."""
    if key in WORDS:
        return WORDS[key](value)
    if "memory_bytes" in key:
        return memory_words(float(value))
    if isinstance(value, Mapping):
        return ", ".join(f"{NAMES.get(k, k)} {word(k, v)}" for k, v in value.items())
    if isinstance(value, list):
        pair = len(value) == 2 and all(isinstance(v, int | float) for v in value)
        between = "; " if any(isinstance(v, Mapping) for v in value) else ", "
        return " to ".join(map(number, value)) if pair else between.join(word("", v) for v in value) or "none"
    return grouped(value) if isinstance(value, int) else number(value) if isinstance(value, float) else str(value)


WORDS: dict[str, Callable[[Any], str]] = {
    "seconds": _about,
    "processor_seconds": _about,
    "chance": lambda share: f"{100.0 * share:.0f} %",
    "accuracy": _goal,
}
