"""Runs of a scene in child processes, and the comparison of two of them."""

from __future__ import annotations

import json
import re
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from linear_bem.errors import ThirdBodyError
from runs.process import signals
from runs.studies.effects.scenes import toml

PROBE = Path(__file__).with_name("probe.py")
UNLIKE_BY_NATURE = ("seconds", "versions")
"""Keys of a result that differ from run to run."""
ROUNDOFF = 1e-9
"""Largest relative difference of two runs of one scene: sums over processes may come in another order."""


@dataclass(frozen=True)
class Account:
    """What a run of a scene loaded, compiled, cost and answered."""

    modules: frozenset[str]
    libraries: frozenset[str]
    compiled: frozenset[str]
    """Modules that the form compiler made: one for each form and each expression."""
    forms: tuple[str, ...]
    """Signatures of the forms, in the order of their compilation."""
    cpu_seconds: float
    memory_bytes: float
    document: Mapping[str, Any]
    functions: frozenset[str] = frozenset()
    """The project's functions that were called, as "module:name"; none where the run was not watched."""
    spread: float = 0.0
    """By which part the longest of several runs took longer than this one, the shortest."""

    @property
    def unknowns(self) -> int:
        """Number of unknowns of the answer's last solve."""
        return int(self.document.get("solved", {}).get("unknowns") or 0)

    @property
    def columns(self) -> frozenset[str]:
        """Names of all entries of the result, with the tables they are in; [] stands for any row."""
        return frozenset(re.sub(r"\[\d+\]", "[]", name) for name, _ in _leaves(self.document))


def run(
    scene: Mapping[str, Mapping[str, object]],
    command: str = "solve",
    blocked: Sequence[str] = (),
    watched: bool = False,
) -> Account:
    """Run a scene in a child process without the modules and functions named; raises `ThirdBodyError`.

    Calls are noted where it is ``watched``, which takes time, and where functions are taken away.
    """
    signals.check()
    with tempfile.TemporaryDirectory(prefix="thirdbody-effects-") as scratch:
        folder = Path(scratch)
        (folder / "scene.toml").write_text(toml(scene), encoding="utf-8")
        words = [command, str(folder / "scene.toml"), "--json", "--out", str(folder / "out")]
        if "finite_strain" in scene:
            words.append("--forms")
        if watched or any(":" in name for name in blocked):
            words.append("--calls")
        probe = [sys.executable, "-P", str(PROBE), str(folder / "account.json"), ",".join(blocked)]
        done = subprocess.run([*probe, *words], capture_output=True, text=True, check=False)
        if done.returncode != 0:
            without = f" without {', '.join(blocked[:5])}" if blocked else ""
            raise ThirdBodyError(f"{command}{without} ended with {done.returncode}: {done.stderr.strip()[-2000:]}")
        found = json.loads((folder / "account.json").read_text(encoding="utf-8"))
        document = json.loads(done.stdout)
    compiled = frozenset(name for name in found["libraries"] if name.startswith("libffcx_"))
    return Account(
        frozenset(found["modules"]),
        frozenset(found["libraries"]) - compiled,
        compiled,
        tuple(found["forms"]),
        found["cpu_seconds"],
        found["memory_bytes"],
        document,
        frozenset(found["functions"]),
    )


def own_functions(without: Account, with_: Account) -> list[str]:
    """Return the project's functions that a run with the effect calls and one without it does not.

    Left out are those in modules of its own, which go with these.
    """
    gone = set(own_modules(without, with_))
    return sorted(name for name in with_.functions - without.functions if name.split(":")[0] not in gone)


def own_modules(without: Account, with_: Account) -> list[str]:
    """Return the project's modules that a run with the effect loads and one without it does not."""
    return sorted(with_.modules - without.modules)


def largest_difference(one: Mapping[str, Any], other: Mapping[str, Any]) -> float:
    """Return the largest relative difference of two results' numbers; infinite where they differ in anything else."""
    first, second = dict(_leaves(one)), dict(_leaves(other))
    if first.keys() != second.keys():
        return float("inf")
    worst = 0.0
    for name, value in first.items():
        against = second[name]
        if isinstance(value, list) and isinstance(against, list) and len(value) == len(against):
            scale = max((abs(v) for v in (*value, *against)), default=0.0)
            change = max((abs(a - b) for a, b in zip(value, against, strict=True)), default=0.0)
            worst = max(worst, change / scale if scale else 0.0)
        elif value != against:
            return float("inf")
    return worst


def _leaves(value: Any, name: str = "") -> Iterator[tuple[str, Any]]:
    """Yield every entry with its path; numbers of a list, and a single number, as a list of numbers."""
    if isinstance(value, Mapping):
        for key, item in value.items():
            if not any(word in key for word in UNLIKE_BY_NATURE):
                yield from _leaves(item, f"{name}.{key}".lstrip("."))
    elif isinstance(value, list) and not all(_is_number(item) for item in value):
        for index, item in enumerate(value):
            yield from _leaves(item, f"{name}[{index}]")
    elif isinstance(value, list):
        yield name, value
    else:
        yield name, [value] if _is_number(value) else value


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)
