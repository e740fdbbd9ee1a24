"""The command ``plan``: effects, size, time and memory of a scene before it is run, and advice on its effects."""

import dataclasses
import math
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from linear_bem.depth import MEANINGLESS
from linear_bem.errors import UnsupportedProblem
from linear_bem.law import Law
from linear_bem.problem import FiniteStrain, Periodic, Problem
from linear_bem.result import Result
from linear_bem.smooth.contacts import CHECKED
from runs.advice import PATIENCE, Advice, Adviser
from runs.comparison import sensitivity
from runs.comparison.linear_states import accuracy_beside
from runs.display import tables
from runs.display.numbers import Scale, attraction, bodies, leading_ball, line_of, number
from runs.display.plan_words import domain, memory_words, name, word
from runs.look_ahead import ABOUT, CLOSE, FEW, ROUGH, ahead_of, closest, measured, memory, out_of_cell, unknowns_of
from runs.models import LINEAR_SECONDS, MODELS, USUAL, Model, as_command, choose, load_path, standing
from runs.process import ranks
from runs.process.json_values import as_given, plain, to_json
from runs.scene import messages
from runs.scene.effects import EFFECTS
from runs.scene.scene_file import Scene
from runs.session.session import left_out
from runs.session.terminal import waiting

PART, SHORTEST, LONGEST = 0.25, 2.0, 5.0
"""For the advice of a plan: largest share of the run's time, least (up to `CHECKED` balls) and largest time [s]."""


def plan_scene(
    scene: Scene, asked: str | None, *, as_json: bool, advises: bool = True, pair_tables: Path | None = None
) -> None:
    """Print the plan of ``solve``, and of ``compare`` if the scene supports it; without advice it takes less time.

    ``pair_tables``: folder of a drift's tables of pairs.
    """
    model, problem, notes = choose(standing(scene), asked)
    drifts = scene.reciprocation is not None
    if drifts:
        from runs.evolution.evolving import require_drift  # noqa: PLC0415  (only for a scene whose balls drift)

        require_drift(scene, model, problem)
    if not ranks.is_root():
        return
    begun, whole, accuracy = time.process_time(), problem, scene.tangential_force
    if drifts:  # full solutions only check the forces of the drift
        accuracy = accuracy or ROUGH
        if "periodic" in scene.drift:
            cell = Periodic(scene.drift["periodic"].lengths)
            whole = dataclasses.replace(problem, periodic=cell, finite_strain=None)
    elif model.plan:
        accuracy = accuracy_beside(accuracy)
    with waiting("the linear model on some of the balls, for this plan"):
        part, seen, ahead, seconds = ahead_of(whole, accuracy)
    plans, evolution = [{"model": model.name, "summary": model.summary}], None
    if drifts:
        from runs.evolution.expectation import expectation  # noqa: PLC0415  (only where balls drift)

        evolution = expectation(scene, model, problem, seconds, pair_tables)
        # advice is about few balls, without the cell
        seconds, part = evolution["seconds"], out_of_cell(part, ahead)
    else:
        plans = _model_plans(scene, model, problem, ahead, seconds, alone=asked is not None)
    scale = Scale.of(problem, scene.data)
    if part.size < problem.size:
        notes = (*notes, f"the expected values are those of the {part.size} balls about the middle alone")
    advice, inputs = list[Advice](), None
    leading = seen[leading_ball([ball.to_dict() for ball in ahead.balls])]
    if advises:
        advice, inputs, more = _advice(scene, problem, part, ahead, seen, _patience(problem, seconds, begun))
        notes = (*notes, *more)
    law, warnings = _law(problem), tables.warnings(ahead.solved.to_dict())
    if problem.finite_strain is not None:  # of the limits of small strain only those on impossible depths
        warnings = [text for text in warnings if MEANINGLESS in text]
    doubts = [f"{law.name}: {text}" for text in law.doubts(problem.layer.poisson)]
    simulated = {*scene.effects} - model.leaves_out
    document = {
        "scene": as_given(scene.data),
        "title": scene.title,
        "bodies": bodies(problem, scale),
        "effects_present": [e for e in EFFECTS if e in simulated],
        "effects_absent": [e for e in EFFECTS if e not in simulated],
        "models": plans,
        "linear_estimate": [ball.to_dict() for ball in ahead.balls],
        "leading_ball": leading,
        "advice": [dataclasses.asdict(item) for item in advice],
        "sensitivity": inputs,
        "warnings": warnings,
        "notes": [*notes, *left_out(scene, model), *_tables_left_out(pair_tables, scene, model), *doubts],
        "evolution": evolution,
    }
    if as_json:
        sys.stdout.write(to_json(document))
    else:
        _show(document, scale, scene, whole)


def _tables_left_out(pair_tables: Path | None, scene: Scene, model: Model) -> list[str]:
    sliding = scene.reciprocation
    if pair_tables is None or (sliding is not None and sliding.forces == "pairs" and model.name != "point_load"):
        return []
    return ["--tables left out: only a drift by pair forces of a full model needs a table of pairs"]


def _law(problem: Problem) -> Law:
    law = (problem.finite_strain or FiniteStrain()).chosen
    assert isinstance(law, Law)  # of a scene
    return law


def _advice(
    scene: Scene, problem: Problem, part: Problem, ahead: Result, seen: Sequence[int], patience: float
) -> tuple[list[Advice], dict[str, Any] | None, list[str]]:
    """Return the advice, the sensitivity of T to the inputs, and notes on both, from the linear solution of a part.

    ``seen``: numbers of its balls; ``patience``: time limit [s].
    """
    ball = leading_ball([each.to_dict() for each in ahead.balls])
    leading = seen[ball]
    close, near = closest(part, ahead)
    ball = ball if close is part else 0
    if near is ahead and "periodic" in scene.drift:  # it was solved in the cell
        near = measured(close, ROUGH)
    law = _law(scene.problem).name
    adviser = Adviser(close, near, scene.tangential_force, scene.effects, patience, law, ball)
    inputs, notes = None, []
    with waiting("the linear model with and without each effect, for this plan's advice; --no-advice leaves it out"):
        advice = adviser.advise()
        if problem.size > 1 and adviser.affords(sensitivity.SOLUTIONS):
            inputs = sensitivity.record(close, ball)
        elif problem.size > 1:
            adviser.left_out.append(sensitivity.TITLE)
    if adviser.left_out:
        names = ", ".join(adviser.left_out)
        few = "the balls in question alone" if problem.periodic is None else "fewer balls"
        notes.append(f"left out, as slow compared with the run: {names}; to compute it, plan a scene of {few}")
    if close is not part:
        which = f"ball {leading}, which has the largest T of those solved, and its {ABOUT - 1} nearest neighbours"
        notes.append(f"the advice considers only {which}")
    if inputs is not None and "ball" in inputs:
        inputs = {**inputs, "ball": leading}
    if advice and problem.balls[leading].radius != problem.balls[0].radius:
        notes.append(f"in the changes of the scene, R is the radius of ball {leading}")
    return advice, inputs, notes


def _patience(problem: Problem, expected: float, begun: float) -> float:
    """Return the time [s] that the advice may take: for many balls, the share `PART` of the run's less the time so far.

    ``expected``: time of the run [s]; ``begun``: processor time at the start of the plan [s].
    """
    if problem.size <= (FEW if problem.periodic is None else CLOSE):
        return PATIENCE
    left = min(PART * expected - (time.process_time() - begun), LONGEST)
    return left if problem.size > CHECKED else max(left, SHORTEST)


def _model_plans(
    scene: Scene, model: Model, problem: Problem, ahead: Result, expected: float, *, alone: bool
) -> list[dict[str, Any]]:
    """Return the plan of ``solve``, and that of the linear model for ``compare`` unless the model is ``alone``."""
    plans = [_model_plan(model, scene, problem, ahead, expected)]
    if not alone and model.plan is not None:
        # compare solves the linear model twice per load step: at equal normal forces and at equal approaches
        states = 2 * len(scene.steps or load_path(problem))
        plans.append(_model_plan(MODELS["linear_bem"], scene, problem, ahead, expected, states))
        if scene.steps is None:
            plans[0]["compare"] = _in_compare(model, scene, problem)
    return plans


def _model_plan(
    model: Model, scene: Scene, problem: Any, ahead: Result, expected: float, states: int = 1
) -> dict[str, Any]:
    """Return the plan of a model; a linear one takes the time ``expected`` [s] per state, beside others or alone."""
    if model.plan is not None:
        details = as_command(model.plan(problem, scene.tangential_force, scene.budget, scene.steps or (1.0,)))
    else:
        details = {
            "symmetries": [],
            "unknowns": unknowns_of(problem, ahead),
            "memory_bytes": memory(problem, ahead),
            "seconds": expected * states,
            "states": states,
        }
        details = details if states > 1 else as_command(details, LINEAR_SECONDS)
    return {"model": model.name, "summary": model.summary, **plain(details)}


def _in_compare(model: Model, scene: Scene, problem: Problem) -> dict[str, Any]:
    """Return load steps, size and times of ``compare``, or why it refuses: its small first step needs a finer mesh."""
    assert model.plan is not None
    try:
        path = as_command(model.plan(problem, scene.tangential_force, scene.budget, None))
    except UnsupportedProblem as error:
        return {"refused": messages.of_problem(str(error), scene.data)}
    shown = ("load_steps", "unknowns", "memory_bytes", "seconds", "processor_seconds", "perhaps")
    return plain({key: path[key] for key in shown if key in path})


def _show(document: Mapping[str, Any], scale: Scale, scene: Scene, problem: Problem) -> None:
    out = tables.console()
    say = partial(tables.say, out)
    say(document["title"], style="bold")
    say(*document["warnings"], *tables.warnings(document))
    load = scene.problem.load
    unit = scale.units.length if load.kind == "approach" else scale.units.force
    known = list(dict.fromkeys(load.values))
    values = ", ".join(map(unit, known)) if len(known) <= CLOSE else f"{unit(min(known))} to {unit(max(known))}"
    say(f"{scene.problem.size} ball(s), prescribed: {load.kind.replace('_', ' ')} {values}")
    say(f"shape: {document['bodies']}")
    say(scale.legend())
    present = [f"  [{e}] {EFFECTS[e].words}" for e in document["effects_present"]]
    say("simulated:", *(present or ["  optional effects: none"]))
    say("not simulated:")
    say(*(f"  [{e}] {EFFECTS[e].words}: {EFFECTS[e].without}" for e in document["effects_absent"]))
    say(*(f"  {note}" for note in tables.notes(document)))
    for model in document["models"]:
        say(f"{model['model']}: {model['summary']}", style="bold")
        for key, value in model.items():
            if key == "domain":
                say(f"  {domain(value, scale.units.length)}")
            elif key not in ("model", "summary", "seconds_of_meshes", "processor_seconds_of_meshes"):
                say(f"  {name(key, model)}: {word(key, value)}")
    evolution = document["evolution"]
    if evolution is not None:
        from runs.evolution.expectation import sentence  # noqa: PLC0415

        memories = {key: memory_words(value) for key, value in evolution.items() if "memory_bytes" in key}
        say(sentence(evolution, document["models"][0]["model"], memories))
    whose = f", on ball {document['leading_ball']}" if scene.problem.size > 1 else ""
    say(f"expected by the linear model{whose}:", style="bold")
    _look_ahead(say, document["linear_estimate"], scale, scene)
    _advise(say, document["advice"], scene.tangential_force)
    found = document["sensitivity"]
    if found is not None:
        tables.show_words(out, sensitivity.TITLE, sensitivity.rows(found, problem, scale))
        say(sensitivity.check(found))


def _look_ahead(say: Callable[..., None], balls: Sequence[Mapping[str, Any]], scale: Scale, scene: Scene) -> None:
    ball = balls[leading_ball(balls)]
    radius = math.sqrt(ball["contact_area"] / math.pi)
    ratio = math.hypot(*ball["tangential_force"]) / ball["normal_force"] if ball["normal_force"] > 0.0 else 0.0
    say(
        f"  D = {scale.both(ball['approach'])}, Q = {scale.units.force(ball['normal_force'])}, "
        f"contact radius {scale.units.length(radius, 3)}, |T| / Q = {number(ratio, 3)}{_sense(scene, balls, ball)}"
    )


def _sense(scene: Scene, balls: Sequence[Mapping[str, Any]], ball: Mapping[str, Any]) -> str:
    """Return whether T pulls the ball towards the others or pushes it away, where that is more than its error.

    In a cell, and for a ball in the middle of the others, there is no such direction; T may also be across it.
    """
    index = balls.index(ball)
    force = ball["tangential_force"]
    _, kind = line_of(balls, index, force, periodic="periodic" in scene.effects)
    known = kind != "tangential" and abs(attraction(balls, index, force)) > ball["tangential_force_error"]
    return f": {kind}" if known else ""


def _advise(say: Callable[..., None], advice: Sequence[Mapping[str, Any]], accuracy: float | None) -> None:
    limit = f"{100.0 * (accuracy or USUAL):.2g} %"
    headings = {True: f"above {limit}", False: f"below {limit}", None: "perhaps"}
    if advice:
        asked = "required accuracy of" if accuracy else "usual accuracy of"
        say(
            f"changes of the scene, and whether they change T by more than the {asked} {limit} (finite strain by a "
            "fit, all else by the linear model):",
            style="bold",
        )
    for matters, heading in headings.items():
        say(*(f"  {heading}: {item['text']}" for item in advice if item["matters"] is matters))
