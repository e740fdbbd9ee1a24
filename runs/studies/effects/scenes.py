"""The effects studied: for each, a scene without it, the same scene with it, and the entry that adds it."""

import json
from collections.abc import Mapping
from dataclasses import dataclass

LAYER = {"thickness": 1.16, "young": 1.0, "poisson": 0.3}
LINEAR: dict[str, Mapping[str, object]] = {
    "layer": LAYER,
    "balls": {"radius": 1.0, "positions": [[-1.25, 0.0], [1.25, 0.0]], "shape": "paraboloid"},
    "load": {"approach": 0.012},
}
ELEMENTS = {
    **LINEAR,
    "finite_strain": {},
    "accuracy": {"tangential_force": 0.2},
    "output": {"fields": ["displacement"]},
}
"""One load step on coarse meshes, with minimal output."""
STIFF = {"young": 1e3, "poisson": 0.3}
SLIDING = {"amplitude": 5.0, "cycles": 5, "friction": 0.3, "forces": "direct"}
DRIFT = LINEAR | {"reciprocation": {"amplitude": 5.0, "cycles": 5, "friction": 0.3}}


@dataclass(frozen=True)
class Effect:
    """An effect: scenes ``without`` and ``with_`` it."""

    name: str
    adds: str
    without: Mapping[str, Mapping[str, object]]
    with_: Mapping[str, Mapping[str, object]]


def effects() -> list[Effect]:
    """Return all effects, those of the linear model first."""
    return [
        Effect("substrate", "[substrate]", LINEAR, LINEAR | {"substrate": STIFF}),
        Effect("exact sphere", 'shape = "sphere"', LINEAR, _sphere(LINEAR)),
        Effect("accuracy control", "[accuracy] to 1e-5", LINEAR, LINEAR | {"accuracy": {"tangential_force": 1e-5}}),
        Effect("reciprocation", "[reciprocation], evolve", LINEAR, LINEAR | {"reciprocation": SLIDING}),
        Effect("periodic cell", "[periodic]", LINEAR, LINEAR | {"periodic": {"lengths": [6.0, 5.0]}}),
        Effect("periodic cell, drift", "[periodic]", DRIFT, DRIFT | {"periodic": {"lengths": [20.0, 20.0]}}),
        Effect("rolling resistance", "[rolling_resistance]", DRIFT, DRIFT | {"rolling_resistance": {"share": 1e-7}}),
        Effect("finite strain", "[finite_strain]", LINEAR, ELEMENTS),
        Effect("substrate (elements)", "[substrate]", ELEMENTS, ELEMENTS | {"substrate": STIFF}),
        Effect("exact sphere (elements)", 'shape = "sphere"', ELEMENTS, _sphere(ELEMENTS)),
        Effect("mixed form", '[elements] form = "mixed"', _form("displacement"), _form("mixed")),
        Effect("field output", "[output], all fields", ELEMENTS, ELEMENTS | {"output": {}}),
        Effect(
            "accuracy control (elements)", "[accuracy] to 0.05", ELEMENTS,
            ELEMENTS | {"accuracy": {"tangential_force": 0.05}},
        ),
    ]  # fmt: skip


def _sphere(scene: Mapping[str, Mapping[str, object]]) -> dict[str, Mapping[str, object]]:
    return {**scene, "balls": {**scene["balls"], "shape": "sphere"}}


def _form(form: str) -> dict[str, Mapping[str, object]]:
    """Return the scene with an element form, at a Poisson's ratio that allows both forms."""
    return ELEMENTS | {"layer": {**LAYER, "poisson": 0.48}, "elements": {"form": form}}


def toml(scene: Mapping[str, Mapping[str, object]]) -> str:
    """Return a scene file's text; JSON strings, numbers and lists are valid TOML."""
    lines = []
    for name, table in scene.items():
        lines += [f"[{name}]", *(f"{key} = {json.dumps(value)}" for key, value in table.items()), ""]
    return "\n".join(lines)
