"""The workflows of the forge: they parse, and the files and extras that their commands name exist."""

from __future__ import annotations

import re
import tomllib

import pytest

from tests.launch import ROOT

WORKFLOWS = sorted((ROOT / ".github" / "workflows").glob("*.yml"))


def test_the_workflows_parse_and_name_what_exists() -> None:
    yaml = pytest.importorskip("yaml", reason="PyYAML comes with the handbook's packages: bash runs/setup.sh docs")
    extras = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]["optional-dependencies"]
    jobs = {name: job for file in WORKFLOWS for name, job in yaml.safe_load(file.read_text())["jobs"].items()}
    assert {"lint", "debian", "dolfinx-image", "linear-core", "wheel", "handbook"} <= set(jobs)
    commands = [step["run"] for job in jobs.values() for step in job["steps"] if "run" in step]
    for command in commands:
        for path in re.findall(r"\b(?:tests|runs)/[\w/.]+", command):
            assert (ROOT / path).exists(), path
        for module in re.findall(r"-m (runs[\w.]+)", command):
            assert ROOT.joinpath(*module.split(".")).with_suffix(".py").exists(), module
        for named in re.findall(r"\.\[([\w,]+)\]", command):
            assert set(named.split(",")) <= set(extras), named
