"""What others read of the project: its workflows name what exists, its citation and archive entry agree with it."""

from __future__ import annotations

import json
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


def test_citation_and_archive_entry_agree_with_the_project() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    citation = (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    archive = json.loads((ROOT / ".zenodo.json").read_text(encoding="utf-8"))
    assert f"\nversion: {project['version']}\n" in citation
    assert f"\nlicense: {archive['license']}\n" in citation
    assert f'title: "{archive["title"]}"' in citation
    for related in archive["related_identifiers"]:
        assert f"doi: {related['identifier']}" in citation
