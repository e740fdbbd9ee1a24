"""Progress of a run: one line per load step on standard error, and a bar on a terminal; every step is passed on.

The remaining time is estimated from the plan and from the pace so far.
"""

from __future__ import annotations

import logging
import time
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from linear_bem.counts import grouped
from linear_bem.report import seldom, silent
from linear_bem.result import Step
from runs.display.numbers import Scale, duration, leading_ball, line_of, number
from runs.process import signals
from runs.session.terminal import on_terminal, print_status

LOG = logging.getLogger("finite_strain")
LAST_OF_SEARCH = 0.9
"""Share of the work done when the path finder begins its last step."""
COUNTED = {"unknowns": "unknowns", "ranks": "rank(s)", "load_steps": "load step(s)", "resumed_steps": "of them saved"}
SMALL_STRAIN = "small strain"
"""Last words of a mesh's name where its states at small strain are solved."""
SOON = 0.5
"""Time left [s] below which no estimate is printed. After a saved mesh the next one is not planned yet, and the
estimate would be 0."""
GROWTH = 1.5
"""Exponent of the growth of time with the number of unknowns from one mesh to the next."""
TRUST = 0.1
"""Share of the planned work after which the pace so far counts as much as the plan's: the first meshes are small, and
their pace says little about that of large ones."""
MODELLED = ("whole model", "half model", "quarter model")


def _setting(info: Mapping[str, Any]) -> str:
    """Return what is run in one phrase: "main mesh: 18 051 unknowns, 2 ranks, 6 load steps, quarter model"."""
    parts = [f"{grouped(info[key])} {words}" for key, words in COUNTED.items() if info.get(key)]
    parts += [MODELLED[info["symmetry_planes"]]] if "symmetry_planes" in info else []
    return f"{info.get('mesh', 'main')} mesh: {', '.join(parts)}"


class Progress:
    """Observer of a load path: all ranks call it; ``root`` prints and passes steps to ``take``.

    ``goal``: the largest approach at full load [m], where approaches are given.
    ``expected``: planned seconds of the first two meshes. ``draw`` gets every step and its surface; where there is
    none, the surface is not gathered. As a context on a terminal it shows a bar with the time passed and left.
    """

    def __init__(
        self, scale: Scale, goal: float | None, *, root: bool, take: Callable[[Step], None],
        log: Callable[[str], None] = silent, draw: Callable[[Step, Any], None] | None = None,
        expected: Sequence[float] = (),
    ) -> None:  # fmt: skip
        self.scale, self.goal, self.root = scale, goal, root
        self.take, self.log, self.draw = take, log, draw
        self.clock = Clock(expected)
        self._bar = Bar(self.clock) if root and expected and on_terminal() else None
        self._step_began = time.monotonic()
        self._seldom = seldom(self._say)
        self._cuts = self._steps = self._steps_done = 0
        self._states = self._states_done = 0.0
        self._small: bool | None = None  # whether the state that is being solved is at small strain
        self._begun = False
        self._messages = _Messages(self._print_status)

    def __enter__(self) -> Progress:
        self._before = LOG.level, LOG.propagate
        if self.root:
            LOG.addHandler(self._messages)
            LOG.setLevel(logging.INFO)
            LOG.propagate = False  # UFL prints what reaches the root
        if self._bar is not None:
            self._bar.bar.start()
        return self

    def __exit__(self, *_: object) -> None:
        LOG.removeHandler(self._messages)
        level, LOG.propagate = self._before
        LOG.setLevel(level)
        if self._bar is not None:
            self._bar.bar.stop()

    def started(self, info: Mapping[str, Any]) -> None:
        """Print size and setting of the run."""
        signals.check()
        self._steps, self._steps_done = info["load_steps"], info["resumed_steps"]
        share = self._steps_done / self._steps
        self._states = float(info.get("states", self._steps))
        self._states_done, self._small = share * self._states, None
        self.clock.next_mesh(float(info["unknowns"]), share)
        if self.root:
            words = _setting(info)
            self.log(f"started: {words}")
            for key, value in info.items():
                if isinstance(value, Mapping):
                    self.log(f"{key}: " + ", ".join(f"{k} {_word(v)}" for k, v in value.items()))
            self._print_status(words, f"{info.get('mesh', 'main')} mesh")

    def attempt(self, mesh: str, fraction: float, cuts: int) -> None:
        """Note that a load step begins."""
        signals.check()
        self._step_began = time.monotonic()
        if not self._begun:
            self._begun = True
            self.clock.begin()
        if self._steps:
            self._state_begins(mesh.endswith(SMALL_STRAIN))
        if self.root:
            self.log(f"attempt: mesh {mesh}, fraction {_word(fraction)}, cuts {cuts}")
            before, self._cuts = self._cuts, cuts
            load = f"{100.0 * fraction:.0f} % of the load"
            where = f"{mesh} mesh: {load}"
            if cuts > before:
                self._print_status(f"the step did not converge: cut back to {load}", where)
            elif mesh != "main":
                self._print_status(f"{where}   {self._times()}", where)
        if not self._steps:  # the path finder: the step that begins now ends there
            self.clock.reached(min(fraction, LAST_OF_SEARCH))

    def _state_begins(self, small: bool | None) -> None:
        """Note that a state begins, at small strain or not, or none; one of the other kind before it is done."""
        if self._small is not None and small != self._small:
            self._states_done += 1.0
        self._small = small
        self.clock.reached(min(self._states_done / self._states, 1.0))

    def newton(self, iteration: int, residual: float) -> None:
        """Check for an interruption at every iteration."""
        signals.check()

    def note(self, text: str) -> None:
        """Print a line of a solver that reports no load steps, every few seconds, and check for an interruption."""
        signals.check()
        if self.root:
            self._seldom(text)

    def _say(self, text: str) -> None:
        words = f"{text}   {self._times()}"
        print_status(words)
        self.log(words)

    def step_done(self, step: Step, surface: Callable[[], Any]) -> None:
        """Pass the step to ``take``, then print it: a printed step is already on disk.

        ``surface`` gathers the deformed surface on rank 0 (collective).
        """
        now = time.monotonic()
        top = surface() if self.draw is not None else None
        self._steps_done += 1
        if self._steps:
            self._state_begins(None)
            if self._steps_done == self._steps:
                self.clock.reached(1.0)
        if self.root:
            text = f"{self._line(step)}   {duration(now - self._step_began)}, {self._times()}"
            self.take(step)
            if self.draw is not None:
                self.draw(step, top)
            self._print_status(text, f"{self._steps_done} of {self._steps} load steps")
            self.log(text)
            self._step_began = time.monotonic()
        signals.check()

    def _print_status(self, text: str, state: str) -> None:
        if self._bar is not None:
            self._bar.show(state)
        print_status(text)

    def _times(self) -> str:
        """Return the time passed and left: "12 s in all, about 40 s left"."""
        left = self.clock.left or 0.0
        return f"{duration(self.clock.elapsed)} in all" + (f", about {duration(left)} left" if left > SOON else "")

    def _line(self, step: Step) -> str:
        balls = [ball.to_dict() for ball in step.balls]
        leading = leading_ball(balls)
        ball = balls[leading]
        deepest = max(each["approach"] for each in balls)
        share = f" ({100.0 * deepest / self.goal:.0f} % of the load)" if self.goal else ""
        words = [f"step {step.record.get('step', '')}".strip()]
        if self.scale.unlike or len(balls) > 2:
            words.append(f"ball {leading}")
        words.append(f"D = {self.scale.both(ball['approach'])}{share}")
        words.append(f"Q = {self.scale.units.force(ball['normal_force'])}")
        if len(balls) > 1:
            force = ball["tangential_force"]
            (x, y), kind = line_of(balls, leading, force)
            ratio = number((x * force[0] + y * force[1]) / ball["normal_force"], 3)
            words.append(f"|T|/Q = {ratio}" if kind == "tangential" else f"T/Q = {ratio} ({kind})")
        if "iterations" in step.record:
            words.append(f"{step.record['iterations']} iterations")
        return "   ".join(words)


class Clock:
    """Estimates the remaining time; ``expected``: planned times [s] of the first meshes, empty without a plan."""

    def __init__(self, expected: Sequence[float] = (), now: Callable[[], float] = time.monotonic) -> None:
        self._expected, self._trust, self._now = list(expected), TRUST * sum(expected), now
        self._began = self._worked = now()
        self._share, self._mesh, self._unknowns, self._saved = 0.0, 0, 0.0, 0.0

    @property
    def elapsed(self) -> float:
        """Seconds since the run began."""
        return self._now() - self._began

    def begin(self) -> None:
        """Note that the work begins: the time before, for example for compilation, does not count towards the pace."""
        self._worked = self._now()

    def next_mesh(self, unknowns: float, saved: float = 0.0) -> None:
        """Begin a mesh, of which the share ``saved`` is done; an unplanned mesh is taken to cost more than the last."""
        self._mesh += 1
        if self._expected and self._mesh >= len(self._expected):
            self._expected.append(self._expected[-1] * (unknowns / self._unknowns) ** GROWTH)
        self._unknowns, self._share = unknowns, saved
        if saved > 0.0:
            self._saved = self._work()

    def reached(self, share: float) -> None:
        """Note the completed share of the current mesh's work."""
        self._share = share

    @property
    def done(self) -> float | None:
        """Completed share of the planned work; None without a plan."""
        total = sum(self._expected)
        return self._work() / total if total > 0.0 else None

    @property
    def left(self) -> float | None:
        """Seconds to the end of the current and all further planned meshes; None without a plan."""
        total = sum(self._expected)
        if total <= 0.0:
            return None
        done = self._work()
        pace = (self._now() - self._worked + self._trust) / (done - self._saved + self._trust)
        return pace * (total - done)

    def _work(self) -> float:
        present = self._expected[self._mesh : self._mesh + 1]
        return sum(self._expected[: self._mesh]) + self._share * sum(present)


class Bar:
    """Progress bar of the planned work with elapsed and remaining time, below the lines of a run."""

    def __init__(self, clock: Clock) -> None:
        from rich.console import Console  # noqa: PLC0415  (only on a terminal)
        from rich.progress import BarColumn, ProgressColumn, TextColumn  # noqa: PLC0415
        from rich.progress import Progress as RichProgress  # noqa: PLC0415
        from rich.table import Column  # noqa: PLC0415
        from rich.text import Text  # noqa: PLC0415

        class Times(ProgressColumn):
            def render(self, task: Any) -> Text:
                left = clock.left
                return Text(duration(clock.elapsed) + (f", about {duration(left)} left" if left else ""))

        words, times = TextColumn("{task.description}", markup=False), Times(Column(no_wrap=True))
        self.bar = RichProgress(
            words, BarColumn(), times, console=Console(stderr=True), transient=True, refresh_per_second=2
        )
        self._clock, self._task = clock, self.bar.add_task("starting", total=1.0)

    def show(self, state: str) -> None:
        """Show what is being done."""
        self.bar.update(self._task, description=state, completed=self._clock.done or 0.0)


class _Messages(logging.Handler):
    """Prints every message of the finite elements' log, each once."""

    def __init__(self, show: Callable[[str, str], None]) -> None:
        super().__init__()
        self._show, self._said = show, set[str]()

    def emit(self, record: logging.LogRecord) -> None:
        """Print a message, unless it was printed before."""
        if (text := record.getMessage()) not in self._said:
            self._said.add(text)
            self._show(text, "compiling")


def _word(value: Any) -> str:
    return number(value) if isinstance(value, float) else str(value)
