"""The whole slice with the real finite elements: interrupted on two ranks, continued on one, fields on disk."""

from __future__ import annotations

import csv
import re
import shutil
import subprocess
import sys
from functools import partial
from pathlib import Path

import pytest

from finite_strain.numerics import Numerics
from tests.launch import ROOT, environment, launcher_forwards_last_words, mpirun, thirdbody
from tests.runs.test_command_line import solved, strict
from tests.scenes import thin_pair

pytestmark = [pytest.mark.slow, pytest.mark.mpi]
COARSE = "tests.runs.coarse"


@pytest.fixture
def scene(tmp_path: Path) -> Path:
    """Return the thin pair on a rigid base, in two light steps and on coarse meshes: seconds instead of minutes."""
    pytest.importorskip("dolfinx")
    path = tmp_path / "light_pair.toml"
    text = thin_pair("tangential_force = 0.3").replace("approach = 0.32", "approach = 0.08\nsteps = [0.04, 0.08]")
    text = re.sub(r"\[substrate\][^[]*", "", text)
    path.write_text(text, encoding="utf-8")
    return path


def stop_after_first_step(scene: Path, out: Path) -> str:
    # a rank answers a signal after its assembly or factorisation; Open MPI's default is to kill it after 1 s
    patient = environment({"OMPI_MCA_odls_base_sigkill_timeout": "5"})
    command = [shutil.which("mpirun") or "mpirun", "-n", "2", "--bind-to", "none", sys.executable, "-m", COARSE]
    command += ["compare", str(scene), "--out", str(out)]
    said = ""
    with subprocess.Popen(command, cwd=ROOT, env=patient, stderr=subprocess.PIPE, text=True) as process:
        assert process.stderr is not None
        for line in process.stderr:
            said += line
            if line.startswith("step 1 "):
                break
        # to the ranks themselves: mpirun 4.1 waits for that timeout before it passes SIGTERM on, too
        subprocess.run(["pkill", "-TERM", "-P", str(process.pid)], check=True, timeout=10.0)
        said += process.stderr.read()
        assert process.wait(timeout=60.0) != 0
    return said


def test_a_real_comparison_survives_interruption_and_tends_to_the_linear_model(scene: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    said = stop_after_first_step(scene, out)
    assert "the same command continues" in said or not launcher_forwards_last_words()
    assert "Traceback" not in said
    assert "on 2 rank(s)" in (out / "run.log").read_text(encoding="utf-8")
    interrupted = strict((out / "result.json").read_text(encoding="utf-8"))["finite"]
    finished = interrupted["steps"]
    assert not interrupted["solved"]["converged"]
    done = mpirun(1, "-m", COARSE, "compare", scene, "--out", out, "--json", timeout=280.0)
    assert done.returncode == 0, done.stderr
    assert "step 1 " not in done.stderr
    document = strict(done.stdout)
    steps = document["finite"]["steps"]
    assert len(steps) >= len(finished)  # the signal may arrive when the last step is on disk
    assert [s["balls"][0]["normal_force"] for s in steps[: len(finished)]] == [
        s["balls"][0]["normal_force"] for s in finished
    ]
    left = [row for row in document["comparison"] if row["ball"] == 0]
    for row in left:
        # theory: at 0.04 to 0.08 R finite strain changes T by a few per cent; the rest is the coarse mesh
        assert abs(row["strengthening_at_force"] - 1.0) < 0.05 + row["strengthening_at_force_error"]
        assert row["strengthening_at_force_error"] > 0.0
        assert row["tangential_finite"][0] < 0.0  # separation
    assert "separation force" in document["answer"]
    with open(out / "steps.csv", encoding="utf-8", newline="") as file:
        assert len(list(csv.DictReader(file))) == 2 * len(steps)
    for name in ("surface.png", "tangential_force.png", "tangential_force.svg", "fields/fields.xdmf"):
        assert (out / name).stat().st_size > 1000, name
    assert len(list((out / "fields").glob("step_*.h5"))) == len(steps)
    again = thirdbody("compare", scene, "--out", out)
    error = 100.0 * left[-1]["normal_force_error"] / left[-1]["normal_force"]
    assert f"estimated errors: Q {error:.2g} %" in again.stdout


def test_small_strain_elements_meet_the_linear_model_by_name(
    scene: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    full = tmp_path / "full.toml"
    full.write_text(scene.read_text(encoding="utf-8").replace("[0.04, 0.08]", "[0.08]"), encoding="utf-8")
    monkeypatch.setattr("finite_strain.Numerics", partial(Numerics, growth=4.0, more_loads=()))
    one, other = (solved(full, model, tmp_path / model) for model in ("small_strain", "linear_bem"))
    assert one.model == "small_strain"
    ours, theirs = one.balls[0], other.balls[0]
    # discretisation: two cells per contact radius leave some per cent of Q; T carries its own error bar
    assert ours.normal_force == pytest.approx(theirs.normal_force, rel=0.05)
    difference = abs(ours.tangential_force[0] - theirs.tangential_force[0])
    assert difference < 0.05 * abs(theirs.tangential_force[0]) + ours.tangential_force_error
