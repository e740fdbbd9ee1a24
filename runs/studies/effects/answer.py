"""The study's tables: the cost of every effect, and the proof that a scene without it pays nothing."""

import dataclasses
import importlib.metadata
import json
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

from runs.process.files import write_csv, write_text
from runs.studies import Options
from runs.studies.effects import measuring
from runs.studies.effects.measuring import ROUNDOFF, Account, largest_difference, own_functions, own_modules
from runs.studies.effects.scenes import Effect, effects, toml
from runs.studies.framework.study import Study, command
from runs.studies.framework.template import render

REPEATS = 3
"""Runs of each scene in the full version; the shortest gives its cost."""
KEPT = "effects.json"
"""File of the study's folder with one row per effect."""


def compute(folder: Path, options: Options) -> None:
    """Measure everything; earlier results are not reused."""
    write_text(folder / KEPT, json.dumps(measure(effects(), quick=options.quick), indent=1))


def page(folder: Path, quick: bool) -> str:
    """Write effects.csv; return the answer as Markdown."""
    try:
        rows = json.loads((folder / KEPT).read_text(encoding="utf-8"))
    except FileNotFoundError:
        rows = []
    write_csv(folder / "effects.csv", rows)
    return report(rows, quick=quick)


def measure(chosen: Sequence[Effect], *, quick: bool) -> list[dict[str, Any]]:
    """Return one row per effect.

    The quick version runs two scenes at a time with call tracing, so that its seconds are rough, and blocks the code of
    all effects at once. The full version runs one scene at a time, traces an extra run, and blocks the code of each
    effect separately.
    """
    repeats, workers = (0, 2) if quick else (REPEATS, 1)
    texts = {toml(scene): scene for e in chosen for scene in (e.without, e.with_)}
    with ThreadPoolExecutor(workers) as pool:
        accounts = dict(zip(texts, pool.map(lambda scene: _best(scene, repeats), texts.values()), strict=True))
        pairs = [(accounts[toml(e.without)], accounts[toml(e.with_)]) for e in chosen]
        own = [own_modules(*pair) + own_functions(*pair) for pair in pairs]
        absent = [
            tuple(sorted({n for other in own for n in other} - without.modules - without.functions) if quick else names)
            for (without, _), names in zip(pairs, own, strict=True)
        ]
        wanted = [(toml(effect.without), names) for effect, names in zip(chosen, absent, strict=True)]
        once = list(dict.fromkeys(wanted))
        proofs = dict(zip(once, pool.map(lambda k: measuring.run(texts[k[0]], k[1]), once), strict=True))
    return [
        _row(effect, *pair, names, proofs[key])
        for effect, pair, names, key in zip(chosen, pairs, own, wanted, strict=True)
    ]


def _best(scene: Any, repeats: int) -> Account:
    watched = measuring.run(scene, watched=True)
    runs = [measuring.run(scene) for _ in range(repeats)]
    if not runs:
        return watched
    best = min(runs, key=lambda account: account.cpu_seconds)
    spread = max(account.cpu_seconds for account in runs) / best.cpu_seconds - 1.0
    return dataclasses.replace(best, functions=watched.functions, spread=spread)


def _row(effect: Effect, without: Account, with_: Account, names: Sequence[str], proof: Account) -> dict[str, Any]:
    difference = largest_difference(without.document, proof.document)
    pays_nothing = (
        proof.forms == without.forms
        and proof.unknowns == without.unknowns
        and proof.modules == without.modules
        and proof.libraries == without.libraries
        and proof.compiled == without.compiled
        and difference <= ROUNDOFF
    )
    kinds = len(set(with_.forms) - set(without.forms))
    expressions = sum("expressions" in name for name in with_.compiled - without.compiled)
    return {
        "effect": effect.name,
        "called for by": effect.adds,
        "unknowns without": without.unknowns,
        "unknowns with": with_.unknowns,
        "forms without": len(set(without.forms)),
        "forms of its own": kinds,
        "expressions of its own": expressions,
        "modules of its own": " ".join(name for name in names if ":" not in name),
        "functions of its own elsewhere": " ".join(name for name in names if ":" in name),
        "libraries of its own": " ".join(sorted(with_.libraries - without.libraries)),
        "result entries of its own": " ".join(
            sorted(name for name in with_.columns - without.columns if not name.startswith("scene"))
        ),
        "seconds without": without.cpu_seconds,
        "seconds with": with_.cpu_seconds,
        "spread of seconds": max(without.spread, with_.spread),
        "MB without": without.memory_bytes / 1e6,
        "MB with": with_.memory_bytes / 1e6,
        "difference of T with its code absent": difference,
        "pays nothing without": pays_nothing,
    }


def report(rows: Sequence[dict[str, Any]], *, quick: bool) -> str:
    """Return the answer as Markdown."""
    brought = {
        "modules": "modules of its own", "functions in other modules": "functions of its own elsewhere",
        "libraries": "libraries of its own", "result": "result entries of its own",
    }  # fmt: skip
    own = [{"effect": row["effect"], **{head: _listed(row[key]) for head, key in brought.items()}} for row in rows]
    proof = [
        {
            "effect": row["effect"],
            "blocked modules": len(row["modules of its own"].split()),
            "blocked functions": len(row["functions of its own elsewhere"].split()),
            "same forms, unknowns, modules, answer": "yes" if row["pays nothing without"] else "NO",
            "largest relative difference": row["difference of T with its code absent"],
        }
        for row in rows
    ]
    return render(
        __file__, rows=rows, own=own, proof=proof, quick=quick,
        paying=[row["effect"] for row in rows if not row["pays nothing without"]],
        bare=[r["effect"] for r in rows if not r["modules of its own"] and not r["functions of its own elsewhere"]],
        spread=max((row["spread of seconds"] for row in rows), default=0.0), repeats=REPEATS,
        command=command("effects", quick), version=importlib.metadata.version("thirdbody"),
    )  # fmt: skip


def _listed(names: str) -> str:
    words = names.split()
    return (
        ", ".join(f"`{word}`" for word in words[:8]) + (f" and {len(words) - 8} more" if len(words) > 8 else "") or "-"
    )


STUDY = Study("effects", compute, page, text="effects.md")
