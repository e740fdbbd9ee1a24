"""What a run tells while it goes: the protocol of its observers. No DOLFINx here."""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol, TypedDict

if TYPE_CHECKING:
    from finite_strain.output.top_surface import SurfaceFields
    from linear_bem.result import Step


class Started(TypedDict):
    """A discretisation that will answer: ``forms`` of the elements by region, ``versions`` of the libraries by name."""

    model: str
    mesh: str
    forms: dict[str, str]
    unknowns: int
    ranks: int
    load_steps: int
    symmetry_planes: int
    resumed_steps: int
    versions: dict[str, str]


class Observer(Protocol):
    """Is called on all ranks. What it raises on all of them ends the run, which resumes after the last finished step.

    The first discretisation makes attempts, each with its iterations, and answers nothing; every later one is started,
    makes attempts, and hands on each step that it has answered and written. A finished run is silent.
    """

    def started(self, info: Started, /) -> None:
        """Hear that a discretisation begins that will answer."""

    def attempt(self, mesh: str, fraction: float, cuts: int, /) -> None:
        """Hear that a load step begins: name of the mesh, load fraction aimed at, cut-backs so far."""

    def newton(self, iteration: int, residual: float, /) -> None:
        """Hear of an iteration and the norm of its residual [N]."""

    def step_done(self, step: Step, surface: SurfaceFields | None, /) -> None:
        """Take an answered step, and on rank 0 the whole scene's top surface."""


class Silence:
    """The observer that does nothing."""

    def started(self, *_: object) -> None:
        """Do nothing."""

    attempt = newton = step_done = started
