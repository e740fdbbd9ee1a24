"""Run a scene in a child process, and compare two runs."""

import json
import subprocess
import sys
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from linear_bem.errors import ThirdBodyError
from runs.studies.effects.scenes import toml
from runs.studies.framework.study import timed

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
