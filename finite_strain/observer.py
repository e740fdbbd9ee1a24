"""The protocol of observers that follow the progress of a run (without DOLFINx)."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Protocol, TypedDict

if TYPE_CHECKING:
    from finite_strain.output.top_surface import SurfaceFields
    from linear_bem.result import Step


class Started(TypedDict):
    """Set-up of a discretisation with results: ``forms`` of elements by region, ``versions`` of libraries.

    ``states``: number of states to be solved, including those at small strain and between the load steps.
    """

    model: str
    mesh: str
    forms: dict[str, str]
    unknowns: int
    ranks: int
    load_steps: int
    symmetry_planes: int
    resumed_steps: int
    states: int
    versions: dict[str, str]


class Observer(Protocol):
    """Called on all ranks. An exception raised on all of them ends the run, which can be resumed after the last step.

    The first discretisation reports attempts and their iterations, but no results. Every later one reports its start,
    its attempts, and each step once its results are on disk. A finished run reports nothing.
    """

    def started(self, info: Started, /) -> None:
        """Receive the start of a discretisation with results."""

    def attempt(self, mesh: str, fraction: float, cuts: int, /) -> None:
        """Receive the start of a load step: name of the mesh, target load fraction, number of cut-backs so far."""

    def newton(self, iteration: int, residual: float, /) -> None:
        """Receive a Newton iteration and its residual norm [N]."""

    def step_done(self, step: Step, surface: Callable[[], SurfaceFields | None], /) -> None:
        """Receive a step with results; ``surface`` gathers the whole scene's top surface on rank 0 (collective).

        Errors of the step may still change: after full load, larger loads also count for steps with few smaller loads.
        """


class Silence:
    """The observer that does nothing."""

    def started(self, *_: object) -> None:
        """Do nothing."""

    attempt = newton = step_done = started
