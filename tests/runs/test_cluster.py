"""The Slurm job script: ranks that see each other, parts of a study, the time limit, and a job that is queued again."""

from __future__ import annotations

import json
import os
import platform
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from tests.launch import ROOT, environment, python

SCRIPT = ROOT / "runs/cluster/thirdbody.slurm"
SRUN = """#!/bin/sh
while [ "${1#-}" != "$1" ]; do [ "$1" = -n ] && shift; shift; done
exec "$@"
"""
"""Starts one process, whatever number it is asked for: as srun does without the MPI of mpi4py."""


class Cluster:
    """A Slurm of one machine: commands of its own on PATH, and a Python environment that only writes down its calls."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.calls = folder / "calls"
        self.program("srun", SRUN)
        self.program("scontrol", f'#!/bin/sh\necho "scontrol $*" >>{self.calls}\n')
        self.program("python", "#!/bin/sh\nexit 0\n")
        self.program("thirdbody", f'#!/bin/sh\necho "thirdbody $*" >>{self.calls}\n')
        self.env = environment(
            {
                "PATH": f"{folder / 'bin'}:{os.environ['PATH']}",
                "VENV": str(folder),
                "XDG_CACHE_HOME": str(folder / "cache"),
                "SLURM_JOB_ID": "7",
                "SLURM_NTASKS": "2",
                "SLURM_SUBMIT_DIR": str(ROOT),
            }
        )

    def program(self, name: str, text: str) -> None:
        path = self.folder / "bin" / name
        path.parent.mkdir(exist_ok=True)
        path.write_text(text, encoding="utf-8")
        path.chmod(0o755)

    def run(self, *args: str, **env: str) -> subprocess.CompletedProcess[str]:
        return subprocess.run(
            ["bash", SCRIPT, *args], capture_output=True, text=True, env=self.env | env, timeout=120, check=False
        )

    def called(self) -> list[str]:
        return self.calls.read_text(encoding="utf-8").splitlines() if self.calls.exists() else []


@pytest.fixture
def cluster(tmp_path: Path) -> Cluster:
    return Cluster(tmp_path)


@pytest.mark.mpi
def test_a_scene_is_solved_once_by_all_ranks(cluster: Cluster, tmp_path: Path) -> None:
    pytest.importorskip("mpi4py")
    done = cluster.run(
        "solve", "runs/scenes/paper_thin_pair_linear.toml", "--out", str(tmp_path / "out"),
        VENV=str(Path(sys.executable).parent.parent), LAUNCHER="mpirun --bind-to none --oversubscribe",
        # Open MPI 5 ends where a job of Slurm lacks these
        SLURM_NODELIST=platform.node(), SLURM_TASKS_PER_NODE="2",
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert json.loads((tmp_path / "out" / "result.json").read_text(encoding="utf-8"))["model"] == "linear_bem"


def test_ranks_that_do_not_see_each_other_are_refused(cluster: Cluster) -> None:
    pytest.importorskip("mpi4py")
    (cluster.folder / "bin" / "python").unlink()
    cluster.program("python", f'#!/bin/sh\nexec {sys.executable} "$@"\n')
    done = cluster.run("solve", "scene.toml")
    assert done.returncode == 2
    assert "1 rank(s) see each other, not 2: srun does not belong to" in done.stderr
    assert "srun --mpi=pmix" in done.stderr
    assert not cluster.called()


def array(number: int, first: int, last: int, count: int) -> dict[str, str]:
    names = ("SLURM_ARRAY_TASK_ID", "SLURM_ARRAY_TASK_MIN", "SLURM_ARRAY_TASK_MAX", "SLURM_ARRAY_TASK_COUNT")
    return dict(zip(names, map(str, (number, first, last, count)), strict=True))


def test_each_job_of_an_array_runs_its_part_of_a_study(cluster: Cluster) -> None:
    assert cluster.run("study", "accuracy", "--quick", **array(3, 1, 8, 8)).returncode == 0
    assert cluster.run("study", "accuracy", **array(5, 3, 5, 2), SHARDS="8").returncode == 0
    assert cluster.called() == ["thirdbody study accuracy --quick --shard 3/8", "thirdbody study accuracy --shard 5/8"]


def test_an_array_that_says_no_number_of_parts_is_refused(cluster: Cluster) -> None:
    part = cluster.run("study", "accuracy", **array(5, 3, 5, 2))
    assert part.returncode == 2
    assert "SHARDS=N" in part.stderr
    scene = cluster.run("solve", "scene.toml", **array(1, 1, 8, 8))
    assert scene.returncode == 2
    assert "an array splits a study" in scene.stderr
    assert not cluster.called()


@pytest.mark.parametrize(("restarts", "code"), [(0, 0), (10, 2)])
def test_a_job_out_of_time_ends_politely_and_is_queued_again_a_limited_number_of_times(
    cluster: Cluster, restarts: int, code: int
) -> None:
    politely = "trap 'echo saved >>{0}; exit 143' TERM; echo began >>{0}; while :; do sleep 0.1; done"
    cluster.program("thirdbody", f"#!/bin/bash\n{politely.format(cluster.calls)}\n")
    job = subprocess.Popen(
        ["bash", SCRIPT, "solve", "scene.toml"], env=cluster.env | {"SLURM_RESTART_COUNT": str(restarts)}
    )
    deadline = time.monotonic() + 60
    while cluster.called() != ["began"]:
        assert time.monotonic() < deadline
        time.sleep(0.05)
    job.send_signal(signal.SIGUSR1)
    assert job.wait(timeout=60) == code
    assert cluster.called() == ["began", "saved", *(["scontrol requeue 7"] if code == 0 else [])]


def test_a_failure_is_not_queued_again(cluster: Cluster) -> None:
    cluster.program("thirdbody", "#!/bin/sh\nexit 1\n")
    assert cluster.run("solve", "scene.toml").returncode == 1
    assert not cluster.called()


def test_a_script_run_by_hand_says_how_it_is_meant(cluster: Cluster) -> None:
    by_hand = cluster.run("solve", "scene.toml", SLURM_JOB_ID="")
    assert by_hand.returncode == 2
    assert "sbatch runs/cluster/thirdbody.slurm solve SCENE" in by_hand.stderr
    elsewhere = cluster.run("solve", "scene.toml", VENV="/nonexistent")
    assert elsewhere.returncode == 2
    assert "VENV=... sbatch" in elsewhere.stderr


def test_processes_that_a_foreign_launcher_starts_do_not_all_solve_the_same(tmp_path: Path) -> None:
    pytest.importorskip("dolfinx")
    scene, out = "runs/scenes/paper_thin_pair.toml", tmp_path / "out"
    first_of_two = {"SLURM_PROCID": "0", "SLURM_STEP_NUM_TASKS": "2"}
    done = python("-m", "runs.cli", "solve", scene, "--out", out, env=first_of_two)
    assert done.returncode == 1
    assert "the launcher started 2 process(es), but mpi4py" in done.stderr
    assert "sees 1" in done.stderr
    assert "Traceback" not in done.stderr
