"""Small strain against finite strain: the forces on two balls, and the outcome of each run."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from linear_bem.arrays import Array
from runs.display.numbers import number
from runs.evolution import equilibria
from runs.evolution.forces import abreast
from runs.evolution.pair_table import PairTable
from runs.studies.experiments import cases
from runs.studies.experiments.cases import CASES
from runs.studies.experiments.points import Documents

KINDS = ("line of six, 25 mm", "pair, 16 mm balls", "pair, 10 mm balls", "pair, 7 mm balls")
"""One case for every kind of ball and layer."""
PLACES = (1.0, 1.25, 1.6, 2.3, 3.7)
"""Distances over the touching distance; a finite-strain table has a run at each."""

NEAR = 0.1
"""No ratio of T is given within this relative distance from a sign change of T."""


@dataclass(frozen=True, eq=False)
class Comparison:
    """A pair of balls in both models at `PLACES`: T/Q, its error, ratios finite / small of T and Q, equilibria [m].

    ``rests`` are (distance, "stable" or "unstable") beyond contact of small strain and of finite strain, up to the end
    of the finite-strain table.
    """

    radius: float
    thickness: float
    approach: float
    small: Array
    finite: Array
    error: Array
    strength: Array
    load: Array
    rests: Sequence[Sequence[tuple[float, str]]]


def comparisons() -> list[Comparison]:
    """Return every kind of pair whose tables are complete in both models; runs no finite elements."""
    found = []
    for case in (case for case in CASES if case.name in KINDS):
        scene = case.read(quick=True)
        small, finite = cases.table("linear_bem", scene), cases.table("finite_strain", cases.finite(case, scene))
        if small.missing == finite.missing == 0:
            found.append(_compared(small, finite))
    return found


def _compared(small: PairTable, finite: PairTable) -> Comparison:
    touch = small.touch
    pairs = [table.of_two() for table in (small, finite)]
    states = [[forces(abreast(place * touch)) for place in PLACES] for forces in pairs]
    pull = np.array([[state.tangential[0, 0] for state in model] for model in states])
    load = np.array([[state.normal[0] for state in model] for model in states])
    rows = {row["distance"]: row["tangential_force_error"] for row in finite.data["pairs"]}
    near = [min(rows, key=lambda d, place=place: abs(d - place * touch)) for place in PLACES]  # type: ignore[misc]
    error = np.array([rows[d] for d in near]) / load[1]
    rests = [[rest for rest in equilibria.of_pair(forces, touch, max(rows)) if rest[0] > touch] for forces in pairs]
    return Comparison(
        small.ball.radius, small.problem.layer.thickness, small.approach, pull[0] / load[0], pull[1] / load[1], error,
        pull[1] / pull[0], load[1] / load[0], rests,
    )  # fmt: skip


def forces(found: Sequence[Comparison]) -> list[dict[str, str]]:
    """Return T/Q over distance in both models, one row per kind of pair."""
    rows = []
    for one in found:
        turns = [distance / (2.0 * one.radius) for rest in one.rests for distance, _ in rest]
        row = {"balls": _kind(one), "D/R": f"{one.approach / one.radius:.3g}"}
        row["h/R"] = f"{one.thickness / one.radius:.3g}"
        for place, small, finite, error, strength in zip(
            PLACES, one.small, one.finite, one.error, one.strength, strict=True
        ):
            cell = f"{small:+.2e} / {finite:+.2e} ± {error:.0e}"
            # the ratio is meaningless near a zero of T
            if not any(abs(place / turn - 1.0) < NEAR for turn in turns):
                cell += f" ({strength:.2f})"
            row[f"L = {place:g} L0"] = cell
        row["T = 0 at L [mm]"] = " / ".join(
            ", ".join(f"{1e3 * d:.1f} ({v})" for d, v in r) or "none" for r in one.rests
        )
        rows.append(row)
    return rows


def sentence(one: Comparison) -> str:
    """Return a sentence on the change of a pair's forces by finite strain."""
    small, finite = ([distance for distance, _ in rests] for rests in one.rests)
    words = (
        f"{_kind(one)} at D = {one.approach / one.radius:.2g} R: T/Q when touching {one.small[0]:+.2e} becomes "
        f"{one.finite[0]:+.2e} ± {one.error[0]:.0e} ({100.0 * (one.finite[0] / one.small[0] - 1.0):+.0f} %), Q "
        f"{100.0 * (one.load[0] - 1.0):+.0f} %"
    )
    if small and finite:
        return f"{words}, T changes sign at {1e3 * finite[0]:.1f} mm instead of {1e3 * small[0]:.1f} mm"
    return f"{words}, and a change of sign of T appears or disappears" if small or finite else words


def _kind(one: Comparison) -> str:
    """Return ball and layer in words; the thicker of the paper's two layers is foam."""
    return (
        f"{2e3 * one.radius:g} mm balls on {1e3 * one.thickness:g} mm of {'foam' if one.thickness > 0.05 else 'rubber'}"
    )


def outcomes(small: Documents, finite: Documents) -> list[dict[str, str]]:
    """Return the outcome of each run that both models have."""
    shown = {
        "cycles to one group (median)": _grouped,
        "contacts at the end (all members)": _contacts,
        "largest distance at the end [mm]": _widest,
    }
    return [
        {"run": name, **{head: f"{write(small[name])} / {write(finite[name])}" for head, write in shown.items()}}
        for name in small
        if name in finite
    ]


def _grouped(document: Mapping[str, Any]) -> str:
    cycles = [m["cycles_one_group"] for m in document["ensemble"]]
    if len(document["ensemble"][0]["positions"]) == 2:
        return "in touch" if document["path"][-1]["contacts"] else "apart"
    middle = float(np.median([math.inf if c is None else c for c in cycles]))
    return number(middle, 3) if math.isfinite(middle) else "never"


def _contacts(document: Mapping[str, Any]) -> str:
    return ", ".join(map(str, sorted({m["contacts"] for m in document["ensemble"]})))


def _widest(document: Mapping[str, Any]) -> str:
    x = np.array(document["path"][-1]["positions"])
    return f"{1e3 * np.max(np.hypot(*(x[:, None] - x[None, :]).T)):.1f}"
