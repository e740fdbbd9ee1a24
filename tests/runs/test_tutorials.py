"""The tutorials run as printed, and become notebooks."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest

from runs.handbook.notebook import notebook
from runs.handbook.tutorials import Tutorial, TutorialFailed
from tests.launch import ROOT

PAGES = ROOT / "runs" / "handbook" / "pages"
TUTORIALS_OF_SECONDS = ("many_balls", "pair_on_rubber", "rough_or_layered")
"""Those without finite elements."""


@pytest.mark.parametrize("name", TUTORIALS_OF_SECONDS)
def test_a_tutorial_runs_as_printed(name: str, tmp_path: Path) -> None:
    page = Tutorial(PAGES / "tutorials" / f"{name}.md", tmp_path, tmp_path).run()
    assert "```output" not in page
    assert all(re.findall(r"^```text\n(.*?)^```$", page, re.DOTALL | re.MULTILINE)), "a block printed nothing"


def test_a_tutorial_that_fails_names_page_and_line(tmp_path: Path) -> None:
    page = tmp_path / "page.md"
    page.write_text("# Title\n\n```sh\nthirdbody solve no_such_scene.toml\n```\n", encoding="utf-8")
    with pytest.raises(TutorialFailed, match=r"page\.md:3: exit code 2"):
        Tutorial(page, tmp_path / "work", tmp_path).run()


@pytest.mark.slow
def test_the_tutorials_at_finite_strain_share_one_run(tmp_path: Path) -> None:
    pytest.importorskip("dolfinx")
    pytest.importorskip("meshio")
    for name in ("how_deep", "post_processing"):
        page = Tutorial(PAGES / "tutorials" / f"{name}.md", tmp_path, tmp_path).run()
        assert all(re.findall(r"^```text\n(.*?)^```$", page, re.DOTALL | re.MULTILINE))


@pytest.mark.slow
@pytest.mark.parametrize("name", ["own_law_or_body", "own_mesh"])
def test_a_tutorial_with_finite_elements_runs_as_printed(name: str, tmp_path: Path) -> None:
    pytest.importorskip("dolfinx")
    page = Tutorial(PAGES / "tutorials" / f"{name}.md", tmp_path, tmp_path).run()
    assert all(re.findall(r"^```text\n(.*?)^```$", page, re.DOTALL | re.MULTILINE))


def test_tables_scroll_and_sentences_wrap_and_a_notebook_joins_them(tmp_path: Path) -> None:
    page = tmp_path / "page.md"
    lines = ["one", "", "a  b", "\u2500\u2500\u2500\u2500", "1  2", "", "two", "", "three"]
    page.write_text(f"```python\nprint({chr(10).join(lines)!r})\n```\n\n```output\n```\n", encoding="utf-8")
    text = Tutorial(page, tmp_path / "work", tmp_path).run()
    found = re.findall(r"^```(text|none)\n(.*?)^```$", text, re.DOTALL | re.MULTILINE)
    assert [kind for kind, _ in found] == ["text", "none", "text"]
    assert found[2][1].split() == ["two", "three"]
    (cell,) = json.loads(notebook(text))["cells"]
    assert [line for line in "".join(cell["outputs"][0]["text"]).splitlines() if line] == [x for x in lines if x]


def test_the_tutorial_of_nine_balls_gathers_them(tmp_path: Path) -> None:
    page = Tutorial(PAGES / "tutorials" / "nine_balls.md", tmp_path, tmp_path).run()
    assert "```output" not in page
    assert "warning:" not in page
    folder = tmp_path / "out" / "nine_balls-evolve-linear_bem"
    assert (folder / "evolution.gif").stat().st_size > 0
    (member,) = json.loads((folder / "result.json").read_text(encoding="utf-8"))["ensemble"]
    assert f"the balls first form one cluster after {member['cycles_one_group']:.3g} cycles" in page


def test_a_tutorial_is_a_notebook_with_what_its_blocks_printed(tmp_path: Path) -> None:
    page = tmp_path / "page.md"
    page.write_text(
        "# Title\n\nSee [there](other.md) and {py:class}`X`.\n\n```toml\n# a.toml\nx = 1\n```\n\n"
        "```sh\ncat a.toml\n```\n\n```output\n```\n\n```python\nprint(6 * 7)\n```\n\n```output\n```\n\nEnd.\n",
        encoding="utf-8",
    )
    written = json.loads(notebook(Tutorial(page, tmp_path / "work", tmp_path).run()))
    kinds = [cell["cell_type"] for cell in written["cells"]]
    assert kinds == ["markdown", "code", "code", "code", "markdown"]
    said, file, shell, python_, _ = ("".join(cell["source"]) for cell in written["cells"])
    assert said == "# Title\n\nSee there and `X`."
    assert file == "%%writefile a.toml\n# a.toml\nx = 1"
    assert shell == "%%bash\ncat a.toml"
    assert python_ == "print(6 * 7)"
    printed = [cell["outputs"][0]["text"] if cell.get("outputs") else [] for cell in written["cells"]]
    assert printed == [[], [], ["# a.toml\n", "x = 1\n"], ["42\n"], []]
    assert written["nbformat"] == 4


def test_printed_tables_scroll_and_printed_sentences_wrap(tmp_path: Path) -> None:
    page = tmp_path / "page.md"
    page.write_text(
        "```python\nfrom linear_bem import *\nballs = (Ball((0.0, 0.0), 1.0),)\n"
        "print(solve(Problem(Layer(1.0, 0.3, 1.0), balls, Load('force', (0.01,)))).summary())\n```\n\n"
        "```output\n```\n\n```python\nprint('A sentence about a ball.')\n```\n\n```output\n```\n",
        encoding="utf-8",
    )
    filled = Tutorial(page, tmp_path / "work", tmp_path).run()
    assert "```none\nResult(linear_bem" in filled
    assert "```text\nA sentence about a ball." in filled


def test_a_picture_is_copied_and_a_notebook_shows_the_one_of_its_run(tmp_path: Path) -> None:
    page = tmp_path / "page.md"
    made = "```sh\nmkdir out more; touch out/a.png more/a.png\n```\n\n"
    shown = "```picture\nout/a.png\nA view\n```\n\n```picture\nmore/a.png\nAnother\n```\n"
    page.write_text(made + shown, encoding="utf-8")
    text = Tutorial(page, tmp_path / "work", tmp_path).run()
    assert '![A view](page-out-a.png "out/a.png")' in text
    assert '![Another](page-more-a.png "more/a.png")' in text
    assert {file.name for file in tmp_path.glob("*.png")} == {"page-out-a.png", "page-more-a.png"}
    assert "![A view](out/a.png)" in notebook(text)
