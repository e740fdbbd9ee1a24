"""The command evolve on two ranks with the real finite elements: a coarse table of pairs, and the path that it gives.

Run as a script, this file is the command line with a table of two distances and of three balls.
"""

from __future__ import annotations

import json
import sys
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from tests.launch import mpirun

DISTANCES, DEPTHS = (1.0, 1.6), (0.6, 0.75, 0.9, 1.05)
SCENE = """
[layer]
thickness = 2.5
young = 1.0
poisson = 0.3
[balls]
radius = 1.0
positions = [[-1.2, 0.0], [1.2, 0.0]]
shape = "sphere"
[load]
approach = 0.25
[finite_strain]
[accuracy]
tangential_force = 0.3
[reciprocation]
amplitude = 5.0
cycles = 1000
friction = 0.3
"""


@pytest.mark.mpi
@pytest.mark.slow
def test_two_ranks_make_a_table_and_follow_the_balls_to_rest(tmp_path: Path) -> None:
    pytest.importorskip("dolfinx")
    file = tmp_path / "pair.toml"
    file.write_text(SCENE, encoding="utf-8")
    out = tmp_path / "out"
    done = mpirun(2, "-m", "tests.runs.test_evolution_ranks", "evolve", file, "--out", out, timeout=900.0)
    assert done.returncode == 0, done.stderr
    document = json.loads((out / "result.json").read_text(encoding="utf-8"))
    table = document["pair_table"]
    assert [row["distance"] for row in table["pairs"]] == [2.0 * d for d in DISTANCES]
    assert [row["arrangement"] for row in table["additivity"]] == ["three in a line"]
    # they attract on this layer, touch, and stay
    assert document["path"][0]["tangential_force"][0][0] > 0.0
    assert document["rest"]["at_rest"]
    assert document["equilibrium"]["verdict"] == "stable"
    assert np.ptp(document["path"][-1]["positions"], axis=0)[0] == pytest.approx(2.0, rel=1e-9)
    assert (out / "evolution.gif").is_file()
    # complete, and known as such to both ranks: the same command shows it without a new run
    again = mpirun(2, "-m", "tests.runs.test_evolution_ranks", "evolve", file, "--out", out, "--json", timeout=400.0)
    assert again.returncode == 0, again.stderr
    assert "complete already" in again.stderr
    assert json.loads(again.stdout) == document


def main() -> None:
    """Run the command line with little of a table, kept beside the scene, and elements that grow fast."""
    import finite_strain  # noqa: PLC0415
    from runs import cli  # noqa: PLC0415
    from runs.evolution import evolving, pair_table  # noqa: PLC0415

    pair_table.FEW = DISTANCES
    pair_table.DEPTHS = DEPTHS
    pair_table.ARRANGEMENTS = {"three in a line": pair_table.ARRANGEMENTS["three in a line"]}
    evolving.TABLES = Path(sys.argv[2]).parent / "tables"
    coarser = partial(finite_strain.Numerics, growth=4.0, more_loads=(), largest_step=0.6)
    finite_strain.Numerics = coarser  # type: ignore[misc, assignment]
    cli.main()


if __name__ == "__main__":
    main()
