"""Code and cost of every effect by runs in child processes, and the proof that a scene without it runs none of it."""

import json
import subprocess
import sys
import tempfile
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from linear_bem.errors import ThirdBodyError
from runs.process.files import read_json, write_csv, write_text
from runs.studies import Options
from runs.studies.effects.scenes import Effect, effects, toml
from runs.studies.framework.page import render
from runs.studies.framework.study import Study, command, timed

PROBE = Path(__file__).with_name("probe.py")
UNLIKE_BY_NATURE = ("seconds", "versions")
"""Words in the keys of results that differ from run to run."""


@dataclass(frozen=True)
class Account:
    """Code used and result returned by a run of a scene.

    ``modules``: the project's modules and other libraries; ``functions``: the project's, as "module:name"; ``forms``:
    signatures of the compiled forms, in their order; ``document``: the result.
    """

    modules: frozenset[str]
    functions: frozenset[str]
    forms: tuple[str, ...]
    document: Mapping[str, Any]

    @property
    def unknowns(self) -> int:
        """Number of unknowns of the answer's last solve."""
        return int(self.document["solved"]["unknowns"])


def run(scene: Mapping[str, Mapping[str, object]], blocked: Sequence[str] = ()) -> Account:
    """Run a scene in a child process with modules and functions ``blocked``; raises `ThirdBodyError`."""
    without = f", without {len(blocked)} modules and functions" if blocked else ""
    with timed(f"[{'], ['.join(scene)}]{without}"), tempfile.TemporaryDirectory(prefix="thirdbody-effects-") as scratch:
        folder = Path(scratch)
        (folder / "scene.toml").write_text(toml(scene), encoding="utf-8")
        command = "evolve" if "reciprocation" in scene else "solve"
        words = [command, str(folder / "scene.toml"), "--json", "--out", str(folder / "out")]
        if command == "evolve":
            words += ["--tables", str(folder / "tables")]
        if "finite_strain" in scene:
            words.append("--forms")
        probe = [sys.executable, "-P", str(PROBE), str(folder / "account.json"), ",".join(blocked)]
        done = subprocess.run([*probe, *words], capture_output=True, text=True, check=False)
        if done.returncode != 0:
            without = f" without {', '.join(blocked[:5])}" if blocked else ""
            raise ThirdBodyError(f"{command}{without} ended with {done.returncode}: {done.stderr.strip()[-2000:]}")
        found = json.loads((folder / "account.json").read_text(encoding="utf-8"))
    return Account(
        frozenset(found["modules"]), frozenset(found["functions"]), tuple(found["forms"]), json.loads(done.stdout)
    )


def own_functions(without: Account, with_: Account) -> list[str]:
    """Return the project's functions that only the run with the effect calls, outside the effect's own modules."""
    own = with_.modules - without.modules
    return sorted(name for name in with_.functions - without.functions if name.split(":")[0] not in own)


def lasting(value: Any) -> Any:
    """Return a result without the entries that differ from run to run."""
    if isinstance(value, Mapping):
        kept = {key: item for key, item in value.items() if not any(word in key for word in UNLIKE_BY_NATURE)}
        return {key: lasting(item) for key, item in kept.items()}
    return [lasting(item) for item in value] if isinstance(value, list) else value


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


STUDY = Study("effects", compute, page, text="effects.md")
