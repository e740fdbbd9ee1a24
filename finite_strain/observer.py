"""The protocol of a run's observers, which follow its progress. No DOLFINx here."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Protocol, TypedDict

if TYPE_CHECKING:
    from finite_strain.output.top_surface import SurfaceFields
    from linear_bem.result import Step


class Started(TypedDict):
    """Setting of an answering discretisation: ``forms`` of the elements by region, ``versions`` of the libraries.

    ``states``: number of those to be solved, at small strain and at loads between the load steps, too.
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
        """Note that an answering discretisation starts."""

    def attempt(self, mesh: str, fraction: float, cuts: int, /) -> None:
        """Note that a load step starts: name of the mesh, target load fraction, number of cut-backs so far."""

    def newton(self, iteration: int, residual: float, /) -> None:
        """Note an iteration and its residual norm [N]."""

    def step_done(self, step: Step, surface: Callable[[], SurfaceFields | None], /) -> None:
        """Take an answered step; ``surface`` gathers the whole scene's top surface on rank 0 (collective).

        Its error bars may still change: after full load, steps with few smaller loads are judged by larger ones, too.
        """


class Silence:
    """The observer that does nothing."""

    def started(self, *_: object) -> None:
        """Do nothing."""

    attempt = newton = step_done = started
