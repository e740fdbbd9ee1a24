"""Notes of a result: what the user must know about its accuracy, its state and its cost."""

import math

import numpy as np

from finite_strain.geometry.load_control import prescribed
from finite_strain.mechanics.own_energy import softening
from finite_strain.mechanics.volumetric import form_notes
from finite_strain.planning.records import Record
from finite_strain.planning.run_plan import RunPlan
from linear_bem.counts import grouped
from linear_bem.depth import overlap_note
from linear_bem.doubts import large_strain_notes
from linear_bem.result import FAINT, UNRESOLVED

HALF = 0.5
"""Relative error above which T, Q or D counts as not resolved."""
NEAR_ZERO = "a tenth of the force between the balls on a half-space"


def is_near_zero(record: Record) -> bool:
    """Return whether the largest T at full load is smaller than the force to which its accuracy refers.

    Only then does the accuracy refer to another force than T.
    """
    return record.scale > max(math.hypot(*ball.tangential_force) for ball in record.steps[-1].balls)


def relative_to(record: Record) -> str:
    """Return the quantity to which the accuracy refers, in words."""
    if record.scale > 0.0:
        return NEAR_ZERO if is_near_zero(record) else "the largest tangential force"
    name = next(iter(record.steps[-1].balls[0].errors))
    return f"the {name.replace('_', ' ')}"


def result_notes(plan: RunPlan, record: Record, why: str, seconds: float) -> list[str]:
    """Return the notes on a discretisation's answers; ``why``: reason for the run's end, ``seconds``: its time [s]."""
    notes, last = form_notes(plan.problem) + softening(plan.problem), record.steps[-1]
    bounds = [(math.hypot(*ball.tangential_force), ball) for ball in last.balls]
    if is_near_zero(record) and record.scale > 0.0:
        known = dict.fromkeys(_percent(b.tangential_force_error / size) for size, b in bounds if size > 0.0)
        notes.append(
            f"T is smaller than {record.scale:.3g} N, {NEAR_ZERO}, to which its accuracy refers"
            + (f"; relative to T itself its error is {', '.join(known)}" if known else "")
        )
    largest = max(size for size, _ in bounds)
    faint = [number for number, (_, ball) in enumerate(bounds) if 0.0 < HALF * largest < ball.tangential_force_error]
    if faint and record.scale > 0.0:  # else T is that of a single ball, 0
        most, force = max(
            (size + ball.tangential_force_error, ball.normal_force) for size, ball in (bounds[i] for i in faint)
        )
        where = "" if len(faint) == len(bounds) else f" on ball {', '.join(map(str, faint))}"
        share = f", {most / force:.2g} of the normal force" if force > 0.0 else ""  # a ball may not touch on the mesh
        notes.append(
            f"{FAINT}{where}: it is at most {most:.2g} N{share}; at small loads linear_bem resolves smaller ones"
        )
    follows = prescribed(plan.problem).follows
    found = [(i, abs(getattr(b, follows)), b.errors.get(follows, 0.0)) for i, b in enumerate(last.balls)]
    unknown = {i: error / value for i, value, error in found if 0.0 < HALF * value < error}
    if unknown and record.scale > 0.0:
        which, shares = ", ".join(map(str, unknown)), dict.fromkeys(map(_percent, unknown.values()))
        notes.append(
            f"the {follows.replace('_', ' ')} of ball {which} is not resolved: its error is {', '.join(shares)}"
        )
    if record.reached > plan.accuracy:
        name = "tangential force" if record.scale > 0.0 else relative_to(record)
        notes.append(
            f"{name} known to {100 * record.reached:.3g} % at full load; "
            f"{100 * plan.accuracy:.2g} % was asked for: {why}"
        )
    if plan.is_paired and record.rows[-1].small is None:
        notes.append(
            "the small-strain problem has no equilibrium at full load: the answer is that of finite strain alone"
        )
    if not record.resolved:
        away, depth = last.distorted_at["volume_ratio"]
        film = "" if last.film is None else f", while {last.film:.2g} of the thickness is left under a ball"
        notes.append(
            f"{UNRESOLVED} {away:.2g} m from a ball's axis and {depth:.2g} m below the surface: the "
            f"volume ratio J falls to {last.smallest_volume_ratio:.2g} there{film}"
        )
    if plan.is_hyperelastic and last.surface_crossing > 0.0:
        notes.append(
            "the flanks of the cleft between mirrored balls pass through each other by "
            f"{2.0 * last.surface_crossing:.2g} m: contact of the surface with itself is not computed"
        )
    elif plan.is_hyperelastic and last.smallest_seen_area <= 0.0:
        away = last.distorted_at["seen_area"][0]
        notes.append(
            f"the surface overhangs {away:.2g} m from a ball's axis: it does not pass through planes of symmetry, but "
            "contact of the surface with itself is not computed"
        )
    approaches = np.array([ball.approach for ball in last.balls])
    if not plan.is_hyperelastic:
        forces, areas = np.array([(ball.normal_force, ball.contact_area) for ball in last.balls]).T
        notes += large_strain_notes(plan.problem, approaches, forces, areas)
    notes += overlap_note(plan.problem, approaches)
    failures = dict.fromkeys(step.linear_failure for step in record.steps if step.linear_failure)
    notes += [f"no correction by the small-strain pair, because linear_bem has no answer: {text}" for text in failures]
    if plan.has_free_sides:
        notes.append(
            "the mesh has free sides: the answer is that of this body, not of the infinite layer of linear_bem; its "
            "error follows from the element orders alone"
        )
    budget = plan.budget  # the first discretisations run in any case
    if budget.unknowns is not None and record.unknowns > budget.unknowns:
        bound = grouped(budget.unknowns)
        notes.append(f"the mesh has {grouped(record.unknowns)} unknowns, more than the budget of {bound}")
    if budget.seconds is not None and seconds > budget.seconds:
        notes.append(f"the discretisations took {seconds:.0f} s, more than the budget of {budget.seconds:g} s")
    return notes


def _percent(share: float) -> str:
    return f"{float(f'{100 * share:.2g}'):g} %"
