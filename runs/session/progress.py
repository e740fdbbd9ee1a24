"""Progress of a run: one line per load step on standard error; every finished step is passed on."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Mapping
from typing import Any

from linear_bem.result import Step
from runs.display.numbers import Scale, attraction, duration, number
from runs.process import signals

COUNTED = {"unknowns": "unknowns", "ranks": "rank(s)", "load_steps": "load step(s)", "resumed_steps": "of them saved"}
EVERY = 2.0
"""Least time [s] between lines of `Progress.note`."""
MODELLED = ("whole model", "half model", "quarter model")


def tell(text: str) -> None:
    """Write a line to standard error."""
    print(text, file=sys.stderr, flush=True)


def _setting(info: Mapping[str, Any]) -> str:
    """Return what is run in one phrase: "main mesh: 18051 unknowns, 2 ranks, 6 load steps, quarter model"."""
    parts = [f"{info[key]} {words}" for key, words in COUNTED.items() if info.get(key)]
    parts += [MODELLED[info["symmetry_planes"]]] if "symmetry_planes" in info else []
    return f"{info.get('mesh', 'main')} mesh: {', '.join(parts)}"


class Progress:
    """Observer of a load path: all ranks call it; ``root`` prints and passes steps to ``take``.

    ``draw`` gets the surface after every step; where there is none, the surface is not gathered.
    """

    def __init__(
        self,
        scale: Scale,
        goal: float | None,
        *,
        root: bool,
        take: Callable[[Step], None],
        log: Callable[[str], None] = lambda text: None,
        draw: Callable[[Any], None] | None = None,
    ) -> None:
        self.scale, self.goal, self.root = scale, goal, root
        self.take, self.log, self.draw = take, log, draw
        self._began = self._step_began = time.monotonic()
        self._noted = self._began
        self._cuts = 0

    def started(self, info: Mapping[str, Any]) -> None:
        """Print size and setting of the run."""
        signals.check()
        if self.root:
            words = _setting(info)
            self.log(f"started: {words}")
            for key, value in info.items():
                if isinstance(value, Mapping):
                    self.log(f"{key}: " + ", ".join(f"{k} {_word(v)}" for k, v in value.items()))
            tell(words)

    def attempt(self, mesh: str, fraction: float, cuts: int) -> None:
        """Note that a load step begins."""
        signals.check()
        self._step_began = time.monotonic()
        if self.root:
            self.log(f"attempt: mesh {mesh}, fraction {_word(fraction)}, cuts {cuts}")
            before, self._cuts = self._cuts, cuts
            if cuts > before:
                tell(f"the step did not converge: cut back to {100.0 * fraction:.0f} % of the load")
            elif mesh != "main":
                tell(f"{mesh} mesh: {100.0 * fraction:.0f} % of the load")

    def newton(self, iteration: int, residual: float) -> None:
        """Check for an interruption at every iteration."""
        signals.check()

    def note(self, text: str) -> None:
        """Print a line of a solver that reports no load steps, every few seconds, and check for an interruption."""
        signals.check()
        now = time.monotonic()
        if self.root and now - self._noted > EVERY:
            self._noted = now
            words = f"{text}   {duration(now - self._began)} in all"
            tell(words)
            self.log(words)

    def step_done(self, step: Step, surface: Callable[[], Any]) -> None:
        """Pass the step to ``take``, then print it: a printed step is already on disk.

        ``surface`` gathers the deformed surface on rank 0 (collective).
        """
        now = time.monotonic()
        top = surface() if self.draw is not None else None
        if self.root:
            text = self._line(step) + f"   {duration(now - self._step_began)}, {duration(now - self._began)} in all"
            self.take(step)
            if self.draw is not None:
                self.draw(top)
            tell(text)
            self.log(text)
            self._step_began = time.monotonic()
        signals.check()

    def _line(self, step: Step) -> str:
        balls = [ball.to_dict() for ball in step.balls]
        leading = max(range(len(balls)), key=lambda i: balls[i]["normal_force"])
        ball = balls[leading]
        approach = ball["approach"] / self.scale.radius
        share = f" ({100.0 * ball['approach'] / self.goal:.0f} %)" if self.goal else ""
        number_of = step.record.get("step", "")
        words = [f"step {number_of}".strip(), f"D = {number(approach)} R{share}"]
        words.append(f"Q = {number(ball['normal_force'] / self.scale.force)} E R^2")
        if len(balls) > 1:
            ratio = attraction(balls, leading, ball["tangential_force"]) / ball["normal_force"]
            words.append(f"T/Q = {number(ratio, 3)}")
        if "iterations" in step.record:
            words.append(f"{step.record['iterations']} iterations")
        return "   ".join(words)


def _word(value: Any) -> str:
    return number(value) if isinstance(value, float) else str(value)
