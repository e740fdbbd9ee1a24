"""The accuracy that a discretisation has reached at its last load step."""

import math

import numpy as np

from finite_strain.force.distortion import is_resolved
from finite_strain.geometry.extent import scale_of_force
from finite_strain.planning.records import Record
from finite_strain.planning.run_plan import RunPlan


def judge(plan: RunPlan, record: Record) -> None:
    """Record the accuracy at the last step: the largest error of a ball's T over the scale, and its terms."""
    if not record.steps:
        return
    last = record.steps[-1]
    if plan.is_hyperelastic:
        film = 1.0 - max(ball.approach for ball in last.balls) / plan.problem.layer.thickness
        record.resolved = is_resolved(last.smallest_volume_ratio, film)
    forces = np.array([ball.normal_force for ball in last.balls])
    pulls = [math.hypot(*ball.tangential_force) for ball in last.balls]
    largest = max(pulls) if len(pulls) > 1 else 0.0  # the T of a single ball is an error, no scale
    record.scale = max(largest, scale_of_force(plan.problem, forces))
    known = [(ball.tangential_force_error, record.scale) for ball in last.balls]
    if record.scale == 0.0:  # without mutual forces the force or approach that was not given counts
        known = [(error, getattr(ball, name)) for ball in last.balls for name, error in ball.errors.items()]
    shares = [error / size if size > 0.0 else 0.0 for error, size in known]
    worst = int(np.argmax(shares))
    record.reached, size = shares[worst], known[worst][1]
    record.terms = {name: values[worst] / size for name, values in last.error_terms.items() if size > 0.0}
    if last.fraction < plan.goals[-1]:
        record.reached = math.inf
