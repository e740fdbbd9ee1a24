"""The nine-ball drift scenes by this checkout and by another version's, in turn: time, steps and end of the path.

    git worktree add ../old 9b6019d && python -m tests.runs.nine_balls ../old     # three minutes of one core

9b6019d is the last commit of version 0.1.0. Every run has a folder of its own, and so computes its table of pairs;
"drift" is without this and without the pictures.
"""

from __future__ import annotations

import json
import resource
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

from runs.studies.framework.page import markdown
from tests.launch import ROOT, environment

SCENES = ("experiment_nine_30mm", "experiment_nine_20mm")
TIMES = 3
COMMAND = "import sys; from runs.cli import main; sys.argv[0] = 'thirdbody'; main()"


def run(checkout: Path, scene: str) -> tuple[float, dict[str, Any]]:
    """Return the processor time [s] of ``thirdbody evolve`` by the code of a checkout, and its document."""
    with tempfile.TemporaryDirectory() as folder:
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        subprocess.run(
            [sys.executable, "-c", COMMAND, "evolve", ROOT / "runs" / "scenes" / f"{scene}.toml", "--out", "run"],
            cwd=folder, env=environment({"PYTHONPATH": str(checkout)}), capture_output=True, check=True,
        )  # fmt: skip
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        document = json.loads((Path(folder) / "run" / "result.json").read_text(encoding="utf-8"))
    return sum(getattr(after, kind) - getattr(before, kind) for kind in ("ru_utime", "ru_stime")), document


def differs(one: dict[str, Any], other: dict[str, Any]) -> float:
    """Return the largest distance of a ball's last positions over R, of all members of the ensembles."""
    ends = [np.array([member["positions"] for member in d["ensemble"]]) for d in (one, other)]
    return float(np.max(np.linalg.norm(ends[0] - ends[1], axis=2))) / one["balls"][0]["radius"]


def main() -> None:
    """Print one row per scene and version."""
    versions = {"this version": ROOT, "the other": Path(sys.argv[1]).resolve()}
    rows = []
    for scene in SCENES:
        found = {name: [] for name in versions}
        for _ in range(TIMES):
            for name, checkout in versions.items():
                found[name].append(run(checkout, scene))
        first = found["this version"][0][1]
        for name, runs in found.items():
            seconds = [spent for spent, _ in runs]
            drifts = [document["solved"]["seconds"] for _, document in runs]
            last = runs[-1][1]
            rows.append({
                "scene": scene, "version": name, "command [s]": ", ".join(f"{s:.1f}" for s in seconds),
                "drift [s]": ", ".join(f"{s:.1f}" for s in drifts), "steps": last["solved"]["iterations"],
                "members at rest in one group": sum(m["at_rest"] and m["groups"] == [9] for m in last["ensemble"]),
                "contacts": ", ".join(sorted({str(m["contacts"]) for m in last["ensemble"]})),
                "error of positions / R": f"{last['position_error'] / last['balls'][0]['radius']:.1e}",
                "last positions differ by, / R": f"{differs(first, last):.1e}",
            })  # fmt: skip
    print(*markdown(rows), sep="\n")


if __name__ == "__main__":
    main()
