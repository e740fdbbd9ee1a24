"""The study's tables: code and cost of every effect, and the proof that a scene without it does not run its code."""

import json
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

from runs.process.files import read_json, write_csv, write_text
from runs.studies import Options
from runs.studies.effects.measuring import Account, lasting, own_functions, run
from runs.studies.effects.scenes import Effect, effects, toml
from runs.studies.framework.page import render
from runs.studies.framework.study import Study, command

KEPT = "effects.json"
"""File of the study's folder with one row per effect."""
LISTED = 8
"""Largest number of names of an effect's own code in a cell of the page."""


def compute(folder: Path, options: Options) -> None:
    """Measure everything, or the effects of the linear model; earlier results are not reused."""
    chosen = [effect for effect in effects() if not (options.quick and "finite_strain" in effect.with_)]
    write_text(folder / KEPT, json.dumps({"effects": measure(chosen)}, indent=1))


def page(folder: Path, quick: bool) -> str:
    """Write effects.csv; return the answer as Markdown."""
    rows = (read_json(folder / KEPT) or {"effects": []})["effects"]
    write_csv(folder / "effects.csv", rows)
    return report(rows, command("effects", quick))


def measure(chosen: Sequence[Effect]) -> list[dict[str, Any]]:
    """Return one row per effect, with the proof: a scene is run again with all code of effects blocked but its own."""
    texts = {toml(scene): scene for effect in chosen for scene in (effect.without, effect.with_)}
    bare = dict.fromkeys(toml(effect.without) for effect in chosen)
    with ThreadPoolExecutor(2) as pool:
        accounts = dict(zip(texts, pool.map(run, texts.values()), strict=True))
        pairs = [(accounts[toml(effect.without)], accounts[toml(effect.with_)]) for effect in chosen]
        own = {name for pair in pairs for name in (*pair[1].modules - pair[0].modules, *own_functions(*pair))}
        blocked = {text: sorted(own - accounts[text].modules - accounts[text].functions) for text in bare}
        proofs = dict(zip(bare, pool.map(lambda text: run(texts[text], blocked[text]), bare), strict=True))
    return [
        _row(effect, *pair, proofs[toml(effect.without)], len(blocked[toml(effect.without)]))
        for effect, pair in zip(chosen, pairs, strict=True)
    ]


def _row(effect: Effect, without: Account, with_: Account, proof: Account, blocked: int) -> dict[str, Any]:
    return {
        "effect": effect.name,
        "requested by": effect.adds,
        "unknowns without": without.unknowns,
        "with": with_.unknowns,
        "forms without": len(set(without.forms)),
        "forms of its own": len(set(with_.forms) - set(without.forms)),
        "modules of its own": " ".join(sorted(with_.modules - without.modules)),
        "functions of its own elsewhere": " ".join(own_functions(without, with_)),
        "blocked": blocked,
        "pays nothing without": proof.forms == without.forms
        and proof.modules == without.modules
        and lasting(proof.document) == lasting(without.document),
    }


def report(rows: Sequence[dict[str, Any]], by: str) -> str:
    """Return the answer as Markdown; ``by`` is the command that made it."""
    shown = [
        {key: _listed(value) if "of its own" in key and isinstance(value, str) else value for key, value in row.items()}
        | {"pays nothing without": "yes" if row["pays nothing without"] else "NO"}
        for row in rows
    ]
    return render(
        __file__, rows=shown, command=by, paying=[row["effect"] for row in rows if not row["pays nothing without"]]
    )


def _listed(names: str) -> str:
    words = names.split()
    more = f" and {len(words) - LISTED} more" if len(words) > LISTED else ""
    return ", ".join(f"`{word}`" for word in words[:LISTED]) + more or "-"


STUDY = Study("effects", compute, page, text="effects.md", resumable=False)
