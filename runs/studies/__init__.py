"""Studies: each answers one question and is run by ``thirdbody study NAME``. To add one, register it below."""

import importlib
from dataclasses import dataclass
from pathlib import Path

from linear_bem.errors import InvalidProblem
from runs.process import ranks

STUDIES = {
    "figures": "the paper's figures 8-12 and two maps of the sign of T",
    "benchmarks": "time and error against other contact codes; scaling with the number of balls",
    "peers": "two balls at finite strain by this project and by other finite-element codes: accuracy and time",
    "strengthening": "how much stronger finite strain makes the tangential force, and how far that depends on the law",
    "fit_range": "how well the fit that `plan` uses for finite strain holds at the ends of its range",
    "accuracy": "processor time for a given accuracy of T",
    "discretisations": "order and size of the elements: accuracy and time on five scenes",
    "experiments": "the paper's drifting balls: simulated runs compared with its observations",
    "collective": "when a layer of many balls gathers, orders, or stays as it is",
    "stability": "hard cases: a correct answer or a refusal that states its reason",
    "deep": "how deep balls can be pressed at finite strain, why the load path stops, and T there",
    "effects": "what code each effect adds and what it costs, and a check that a scene without it runs none of it",
    "verification": "the finite-strain model against closed-form solutions and itself",
    "validation": "published results of others compared with this project's",
    "scaling": "time and memory of the finite elements' linear systems by size, solver and ranks",
}
"""Name and question of every study; ``runs.studies.NAME.answer.STUDY`` answers it."""
SHARED_OUT = frozenset(
    {"strengthening", "fit_range", "accuracy", "deep", "discretisations", "stability", "verification", "validation"}
)
"""Studies that ``--shard`` can split; not ``scaling``, which compares times on one machine."""
ON_ALL_RANKS = SHARED_OUT | {"scaling"}
"""Studies that solve finite-element cases: every rank runs them; the others run on rank 0 only."""


@dataclass(frozen=True)
class Options:
    """Command-line options of a study: ``quick`` is coarser, ``out`` the output folder, ``fresh`` starts again.

    ``shard`` (i, n): part i of n, counted from 1; ``tables``: only make tables and figures from saved answers;
    ``publish``: write them into the study's README.
    """

    quick: bool = False
    out: Path | None = None
    fresh: bool = False
    shard: tuple[int, int] = (1, 1)
    tables: bool = False
    publish: bool = False


def listing() -> str:
    """Return the names of all studies with their questions."""
    return "; ".join(f"{name} ({question})" for name, question in STUDIES.items())


def read_shard(text: str) -> tuple[int, int]:
    """Return (i, n) of "i/n", the i-th of n parts; raises `InvalidProblem` for anything else."""
    part, _, parts = text.partition("/")
    if part.isdecimal() and parts.isdecimal() and 1 <= int(part) <= int(parts):
        return int(part), int(parts)
    raise InvalidProblem(f'--shard: must be i/n with 1 <= i <= n, such as 2/5, got "{text}"')


def run_study(name: str, options: Options) -> None:
    """Run the study ``name``; raises `InvalidProblem` for an unknown name and for options that the study lacks."""
    if name not in STUDIES:
        raise InvalidProblem(f'study: there is no study "{name}"; known: {listing()}')
    if name not in SHARED_OUT and options.shard != (1, 1):
        raise InvalidProblem(f"--shard: study {name} cannot be split; only {', '.join(sorted(SHARED_OUT))} can")
    if options.publish and options.quick:
        raise InvalidProblem("--publish: only the full version of a study is published; leave out --quick")
    if name in ON_ALL_RANKS or ranks.is_root():
        from runs.studies.framework.study import run  # noqa: PLC0415  (the list above must import nothing)

        run(importlib.import_module(f"runs.studies.{name}.answer").STUDY, options)
