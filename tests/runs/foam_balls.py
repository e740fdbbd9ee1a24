"""Balls on the paper's foam that several tests move, and the forces on them."""

from __future__ import annotations

from pathlib import Path

from linear_bem import Ball, Layer, Load, Problem
from runs.evolution.pair_forces import PairForces
from runs.evolution.providers import Provider, provider
from runs.models import MODELS

FOAM = Layer(57.4e3, 0.3, 0.08)
RADIUS, APPROACH = 0.01, 0.012


def scene(positions: list[tuple[float, float]], layer: Layer = FOAM, approach: float = APPROACH) -> Problem:
    balls = tuple(Ball(p, RADIUS, "sphere") for p in positions)
    return Problem(layer, balls, Load("approach", (approach,) * len(balls)))


def line(count: int, distance: float) -> list[tuple[float, float]]:
    return [((i - 0.5 * (count - 1)) * distance, 0.0) for i in range(count)]


def of(name: str, problem: Problem, folder: Path) -> Provider:
    return provider(MODELS[name], problem, None, "pairs", folder)


def spread(forces: Provider, problem: Problem) -> PairForces:
    """Return the same law for another number of the same balls."""
    pair = forces.forces
    assert isinstance(pair, PairForces)
    return PairForces(problem, [pair.singles[0]] * problem.size, pair.law, pair.share)
