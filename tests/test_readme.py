"""The README's blocks do what they say, and what it shows is there."""

from __future__ import annotations

import re

from tests.launch import ROOT, python

TEXT = (ROOT / "README.md").read_text(encoding="utf-8")


def blocks(language: str) -> list[str]:
    return re.findall(rf"^```{language}\n(.*?)^```$", TEXT, flags=re.DOTALL | re.MULTILINE)


def test_the_python_block_has_eight_lines_and_meets_the_reference(tmp_path):
    (block,) = blocks("python")
    assert len([line for line in block.splitlines() if line.strip()]) == 8
    script = tmp_path / "readme.py"
    script.write_text(block, encoding="utf-8")
    done = python(str(script))
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith("T = -1.1612")


def test_the_readme_is_a_front_page():
    assert len(TEXT.splitlines()) <= 120
    pictures = re.findall(r'<img src="([^"]+)"', TEXT)
    assert len(pictures) == 2
    assert TEXT.index(pictures[0]) < TEXT.index("## ")
    assert sum((ROOT / name).stat().st_size for name in pictures) < 1e6


def test_the_factors_of_the_readme_are_the_published_ones():
    study = (ROOT / "runs" / "studies" / "strengthening" / "README.md").read_text(encoding="utf-8")
    factors = re.findall(r"[\d.]+ ± [\d.]+", TEXT)
    assert len(factors) == 2
    for factor in factors:
        assert f"| {factor} |" in study, factor


def test_every_path_that_the_readme_names_exists():
    for path in re.findall(r"\b((?:runs|tests|linear_bem|finite_strain|meshes)/[\w./]*)", TEXT):
        assert (ROOT / path).exists(), path
    for link in re.findall(r"\]\(((?!https?:)[^)]+)\)", TEXT):
        assert (ROOT / link).exists(), link


def test_every_command_that_the_readme_names_exists():
    done = python("-m", "runs.cli", "--help")
    for name in re.findall(r"`thirdbody (\w+)", TEXT):
        assert re.search(rf"\b{name}\b", done.stdout), f"README names `thirdbody {name}`"
