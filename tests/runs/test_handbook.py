"""The handbook: its generated parts follow the code, its pages name what there is, and it builds."""

from __future__ import annotations

import dataclasses
import re
from itertools import pairwise
from pathlib import Path

import pytest

from linear_bem.law import LAWS
from runs.cli import app
from runs.handbook import build, command_reference, scene_reference
from runs.handbook.build import study_table, with_one_title
from runs.scene.messages import tables_of
from runs.scene.scene_file import Tables, read_scene
from runs.studies import STUDIES
from tests.launch import ROOT, python

PAGES = ROOT / "runs" / "handbook" / "pages"


def test_the_scene_reference_explains_every_key_of_the_tables() -> None:
    page = scene_reference.page()
    for name, kind in tables_of(Tables):
        section = page.partition(f"## `[{name}]`")[2].partition("\n## ")[0]
        for key, field in kind.model_fields.items():
            row = re.search(rf"^\| `{key}` \| (.*) \|$", section, re.MULTILINE)
            assert row, f"[{name}] {key}"
            said, value, *_ = row[1].split(" | ")
            assert value, f"[{name}] {key}: what may its value be?"
            assert said == " ".join((field.description or "").split()) != "", f"[{name}] {key} is not explained"


def test_the_scene_reference_names_every_law_and_its_numbers() -> None:
    section = scene_reference.page().partition("## `[finite_strain]`")[2].partition("\n## ")[0]
    rows = {row.split("`")[1]: row for row in section.splitlines() if row.startswith("| `")}
    for name, law in LAWS.items():
        assert f"`{name}`" in rows["law"]
        for number in dataclasses.fields(law):
            assert f"`{name}`" in rows[number.name]


def test_the_scene_reference_says_in_plain_words_what_a_key_takes() -> None:
    page = scene_reference.page()
    for key, words in (
        ("every", "integer"), ("seed", "integer"), ("positions", r"list of \[x, y\] \(m\)"), ("steps", "list of loads"),
        ("ratios", "list of numbers"), ("direction", "list of two numbers"), ("unknowns", r"number \|  \| `100000`"),
    ):  # fmt: skip
        assert re.search(rf"^\| `{key}` \| [^|]* \| {words} ", page, re.MULTILINE), key


def test_the_scene_reference_knows_lists_that_are_not_of_balls() -> None:
    section = scene_reference.page().partition("## `[periodic]`")[2].partition("\n## ")[0]
    assert "| two lengths (m) |" in section


def test_the_command_reference_lists_every_command_and_option() -> None:
    page = command_reference.page()
    for command in app.registered_commands:
        assert f"## `{command.name or command.callback.__name__}`" in page
    assert "--shard i/n" in page


def test_the_scene_of_the_first_page_is_a_scene(tmp_path: Path) -> None:
    text = (PAGES / "start.md").read_text(encoding="utf-8")
    (block,) = re.findall(r"^```toml\n(.*?)^```$", text, re.DOTALL | re.MULTILINE)
    file = tmp_path / "scene.toml"
    file.write_text(block, encoding="utf-8")
    scene = read_scene(file)
    assert scene.problem.finite_strain is not None
    assert scene.problem.layer.thickness == pytest.approx(0.010)


def test_every_command_and_path_that_the_pages_name_exists() -> None:
    commands = {c.name or c.callback.__name__ for c in app.registered_commands}
    for page in PAGES.rglob("*.md"):
        text = page.read_text(encoding="utf-8")
        for name in re.findall(r"(?:^|`)thirdbody ([a-z]\w*)", text, flags=re.MULTILINE):
            assert name in commands, f"{page.name} names `thirdbody {name}`"
        for path in re.findall(r"(?<![\w/.-])((?:runs|tests|linear_bem|finite_strain|meshes)/[\w./]*)", text):
            assert (ROOT / path).exists(), f"{page.name}: {path}"
        for link in re.findall(r"\]\((\.\./[^)#]*)", text):
            if not (page.parent / link).resolve().is_relative_to(PAGES):
                assert (page.parent / link).exists(), f"{page.name}: {link}"


def test_every_picture_of_a_page_is_in_the_project() -> None:  # so that the page shows it where it is not built
    for page in PAGES.rglob("*.md"):
        for picture in re.findall(r"!\[[^]]*\]\(([^)]+)\)", page.read_text(encoding="utf-8")):
            assert (page.parent / picture).exists(), f"{page.name}: {picture}"


def test_no_value_of_a_page_is_broken_over_two_lines() -> None:
    for page in PAGES.rglob("*.md"):  # where it is, the built page shows the braces
        assert not re.search(r"{{[^}]*\n", page.read_text(encoding="utf-8")), page.name


def test_code_on_the_pages_is_as_narrow_as_the_page() -> None:
    pages = [*PAGES.rglob("*.md"), ROOT / "README.md", ROOT / "linear_bem" / "README.md"]
    for page in pages:  # the rest of a wider line is out of sight until the reader scrolls
        text = page.read_text(encoding="utf-8")
        for block in re.findall(r"^```(?!picture)\w.*?^```", text, flags=re.MULTILINE | re.DOTALL):
            for line in block.splitlines():
                assert len(line) <= 106, f"{page.name}: {line}"


BUILD = """
import sys
from pathlib import Path
from runs.handbook.build import build
sys.exit(build(Path(sys.argv[1]), run_tutorials=False))
"""


@pytest.mark.slow
def test_the_handbook_builds_without_a_warning(tmp_path: Path) -> None:
    pytest.importorskip("sphinx", reason="the handbook needs Sphinx: bash runs/setup.sh docs")
    pytest.importorskip("myst_parser")
    pytest.importorskip("furo")
    # in a process of its own, as the command: it stands in for libraries that this one may have loaded
    done = python("-c", BUILD, tmp_path)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "Problem" in (tmp_path / "html" / "api.html").read_text(encoding="utf-8")
    for page in PAGES.rglob("*.md"):
        assert (tmp_path / "html" / page.relative_to(PAGES)).with_suffix(".html").exists()


def test_a_tutorial_finds_no_run_of_an_earlier_build(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    page = tmp_path / "page.md"
    page.write_text("```sh\ncat run || echo none\necho earlier > run\n```\n\n```output\n```\n", encoding="utf-8")
    monkeypatch.setattr(build, "tutorials", lambda: [page])
    for _ in range(2):
        build.prepare(tmp_path / "sources")
        assert "```text\nnone\n```" in (tmp_path / "sources" / "tutorials" / "page.md").read_text(encoding="utf-8")


def test_the_page_of_validation_has_every_study_with_its_published_answer() -> None:
    rows = study_table().splitlines()[2:]
    assert [row.split("[")[1].split("]")[0] for row in rows] == list(STUDIES)
    published = (ROOT / "runs/studies/stability/README.md").read_text(encoding="utf-8")
    (said,) = (row.split(" | ")[1].removesuffix(" |") for row in rows if "[stability]" in row)
    assert said.startswith("Of ") and said in published.replace("**", "")  # noqa: PT018
    assert next(row for row in rows if "[figures]" in row).endswith("by 3.55 % at h' = 9.22. |")
    strengthening = next(row for row in rows if "[strengthening]" in row).split(" | ")[1]
    assert strengthening.startswith("Finite strain strengthens T by more than the error bar for")


@pytest.mark.parametrize("name", STUDIES)
def test_the_page_of_a_study_has_one_title(name: str) -> None:  # a second one would be another entry of the contents
    page = with_one_title((ROOT / f"runs/studies/{name}/README.md").read_text(encoding="utf-8"))
    assert re.findall(r"^# .*", page, re.MULTILINE) == [f"# Study: {name}"]
    levels = [len(marks) for marks in re.findall(r"^(#+) ", page, re.MULTILINE)]
    assert all(after <= before + 1 for before, after in pairwise(levels))
