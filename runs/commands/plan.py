"""The command ``plan``: what a scene would simulate and what not, how large it is and how long it takes."""

from __future__ import annotations

import dataclasses
import math
import sys
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from linear_bem.result import Result
from runs.advice import USUAL, Adviser
from runs.display import tables
from runs.display.numbers import Scale, bodies, duration, number
from runs.models import MODELS, Model, Run, choose, load_path, standing, without
from runs.process import ranks
from runs.process.json_values import as_given, plain, to_json
from runs.scene.effects import EFFECTS
from runs.scene.scene_file import Scene

NAMES = {
    "forms": "form of the elements",
    "linear_solver": "linear solver of the finest mesh planned",
    "memory_bytes": "memory",
    "memory_bytes_at_most": "memory of the finest mesh that the budget allows",
    "seconds": "time",
    "symmetries": "symmetries used",
    "domain": "domain [m]",
    "meshes": "meshes",
    "accuracy": "refined until",
}
MANY = 100
"""Balls that drift whose linear solution is not part of a plan: it takes minutes."""
ROUGH = 1e-2
"""Relative accuracy of the linear solution on which a plan is based."""


def plan_scene(scene: Scene, asked: str | None, *, as_json: bool) -> None:
    """Print the plan of ``solve``, and of ``compare`` if the scene supports it."""
    model, problem, notes = choose(standing(scene), asked)
    if not ranks.is_root():
        return
    if scene.reciprocation is not None and problem.size > MANY:
        from runs.evolution.expectation import expectation, sentence  # noqa: PLC0415  (only where balls drift)

        expected = expectation(scene)
        sys.stdout.write(to_json(expected) if as_json else f"{scene.title}\n{sentence(expected)}\n")
        return
    ahead = MODELS["linear_bem"].solve(without(problem, ["finite_strain"]), Run(ROUGH))
    plans = [_model_plan(model, scene, problem, ahead)]
    if asked is None and model.plan is not None:
        # compare solves the linear model twice per load step: at equal normal forces and at equal approaches
        states = 2 * len(scene.steps or load_path(problem))
        plans.append(_model_plan(MODELS["linear_bem"], scene, problem, ahead, states))
    advice = Adviser(problem, ahead, scene.tangential_force, scene.effects).advise()
    document = {
        "scene": as_given(scene.data),
        "title": scene.title,
        "bodies": bodies(problem),
        "effects_present": [e for e in EFFECTS if e in scene.effects and e not in model.leaves_out],
        "effects_absent": [e for e in EFFECTS if e not in scene.effects or e in model.leaves_out],
        "models": plans,
        "linear_estimate": [ball.to_dict() for ball in ahead.balls],
        "advice": [dataclasses.asdict(item) for item in advice],
        "notes": list(notes),
    }
    if as_json:
        sys.stdout.write(to_json(document))
    else:
        _show(document, Scale.of(problem), scene)


def _model_plan(model: Model, scene: Scene, problem: Any, ahead: Result, states: int = 1) -> dict[str, Any]:
    if model.plan is not None:
        details = model.plan(problem, scene.tangential_force, scene.budget, scene.steps or (1.0,))
    else:
        details = {
            "symmetries": [],
            "unknowns": ahead.solved.unknowns,
            "memory_bytes": 8.0 * ahead.solved.unknowns**2,
            "seconds": ahead.solved.seconds * states,
            "states": states,
        }
    return {"model": model.name, "summary": model.summary, **plain(details)}


def _show(document: Mapping[str, Any], scale: Scale, scene: Scene) -> None:
    out = tables.console()

    def say(text: str, style: str = "") -> None:
        out.print(text, style=style, highlight=False, markup=False)

    say(document["title"], "bold")
    load = scene.problem.load
    unit = "m" if load.kind == "approach" else "N"
    values = ", ".join(number(value) for value in dict.fromkeys(load.values))
    say(f"{scene.problem.size} ball(s), prescribed: {load.kind} {values} {unit}")
    say(f"shape: {document['bodies']}")
    say("simulated:")
    for name in document["effects_present"]:
        say(f"  [{name}] {EFFECTS[name].words}")
    if not document["effects_present"]:
        say("  no optional effect")
    say("not simulated:")
    for name in document["effects_absent"]:
        say(f"  [{name}] {EFFECTS[name].words}: {EFFECTS[name].without}")
    for note in document["notes"]:
        say(f"  note: {note}")
    for model in document["models"]:
        say(f"{model['model']}: {model['summary']}", "bold")
        for key, value in model.items():
            if key not in ("model", "summary"):
                say(f"  {NAMES.get(key, key.replace('_', ' '))}: {_word(key, value)}")
    _look_ahead(say, document["linear_estimate"], scale)
    _advise(say, document["advice"], scene.tangential_force)


def _look_ahead(say: Callable[..., None], balls: Sequence[Mapping[str, Any]], scale: Scale) -> None:
    ball = max(balls, key=lambda b: (math.hypot(*b["tangential_force"]), b["normal_force"]))
    radius = math.sqrt(ball["contact_area"] / math.pi)
    ratio = math.hypot(*ball["tangential_force"]) / ball["normal_force"] if ball["normal_force"] > 0.0 else 0.0
    say("expected by the linear model:", "bold")
    say(
        f"  D = {number(ball['approach'] / scale.radius)} R, "
        f"Q = {number(ball['normal_force'] / scale.force)} E R\u00b2, "
        f"contact radius {number(radius / scale.radius, 3)} R, |T| / Q = {number(ratio, 3)}"
    )


def _advise(say: Callable[..., None], advice: Sequence[Mapping[str, Any]], accuracy: float | None) -> None:
    headings = {True: "matters", False: "below that", None: "perhaps"}
    if advice:
        say(f"what would change T by more than {100.0 * (accuracy or USUAL):.2g} %, by the linear model:", "bold")
    for matters, heading in headings.items():
        for item in advice:
            if item["matters"] is matters:
                say(f"  {heading}: {item['text']}")


def _goal(accuracy: Mapping[str, Any]) -> str:
    seconds = accuracy["seconds_at_most"]
    limit = "no time limit" if seconds is None else f"at most {duration(float(seconds))}"
    known = f"T is known to {100 * accuracy['asked']:.3g} %"
    return f"{known}; at most {accuracy['unknowns_at_most']:.0f} unknowns; {limit}"


def _word(key: str, value: Any) -> str:
    if key == "seconds":
        return f"about {duration(float(value))}"
    if key.startswith("memory_bytes"):
        return f"about {float(value) / 1e9:.2g} GB" if value > 5e7 else f"about {max(float(value) / 1e6, 1.0):.0f} MB"
    if key == "accuracy":
        return _goal(value)
    if isinstance(value, Mapping):
        return ", ".join(f"{k} {_word(k, v)}" for k, v in value.items())
    if isinstance(value, list):
        pair = len(value) == 2 and all(isinstance(v, int | float) for v in value)
        return " to ".join(map(number, value)) if pair else ", ".join(_word("", v) for v in value) or "none"
    return number(value) if isinstance(value, float) else str(value)
