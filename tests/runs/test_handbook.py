"""The handbook: its generated parts follow the code, its tutorials run as printed, its live page meets the solver."""

from __future__ import annotations

import dataclasses
import html
import json
import re
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.integrate import simpson

from linear_bem import solve_contact
from linear_bem.law import LAWS
from runs.cli import app
from runs.handbook import command_reference, scene_reference
from runs.handbook.build import study_table
from runs.handbook.live import table, widget
from runs.handbook.live.chebyshev import Axis, interpolate
from runs.handbook.notebook import notebook
from runs.handbook.tutorials import Tutorial, TutorialFailed
from runs.scene.effects import EFFECTS
from runs.scene.scene_file import read_scene
from runs.studies import STUDIES
from tests.launch import ROOT, headless_browser, python

PAGES = ROOT / "runs" / "handbook" / "pages"
TUTORIALS_OF_SECONDS = ("many_balls", "pair_on_rubber", "rough_or_layered")
"""Those without finite elements."""


def test_the_scene_reference_explains_every_key_of_the_tables() -> None:
    page = scene_reference.page()
    for name, kind in scene_reference.tables():
        section = page.partition(f"## `[{name}]`")[2].partition("\n## ")[0]
        for key, field in kind.model_fields.items():
            row = re.search(rf"^\| `{key}` \| (.*) \|$", section, re.MULTILINE)
            assert row, f"[{name}] {key}"
            assert row[1].split(" | ")[0], f"[{name}] {key}: what may its value be?"
            in_prose = f"`{key}`" in section.partition("| key |")[0]
            assert field.description or in_prose or name in EFFECTS, f"[{name}] {key} is not explained"


def test_the_scene_reference_names_every_law_and_its_numbers() -> None:
    section = scene_reference.page().partition("## `[finite_strain]`")[2].partition("\n## ")[0]
    rows = {row.split("`")[1]: row for row in section.splitlines() if row.startswith("| `")}
    for name, law in LAWS.items():
        assert f"`{name}`" in rows["law"]
        for number in dataclasses.fields(law):
            assert f"`{name}`" in rows[number.name]


def test_the_scene_reference_knows_lists_that_are_not_of_balls() -> None:
    section = scene_reference.page().partition("## `[periodic]`")[2].partition("\n## ")[0]
    assert "| `lengths` | two lengths (m) |" in section


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
        for path in re.findall(r"(?<![\w/.])((?:runs|tests|linear_bem|finite_strain|meshes)/[\w./]*)", text):
            assert (ROOT / path).exists(), f"{page.name}: {path}"
        for link in re.findall(r"\]\((\.\./[^)#]*)", text):
            if not (page.parent / link).resolve().is_relative_to(PAGES):
                assert (page.parent / link).exists(), f"{page.name}: {link}"


def test_no_value_of_a_page_is_broken_over_two_lines() -> None:
    for page in PAGES.rglob("*.md"):  # where it is, the built page shows the braces
        assert not re.search(r"{{[^}]*\n", page.read_text(encoding="utf-8")), page.name


@pytest.mark.parametrize("name", TUTORIALS_OF_SECONDS)
def test_a_tutorial_runs_as_printed(name: str, tmp_path: Path) -> None:
    page = Tutorial(PAGES / "tutorials" / f"{name}.md", tmp_path).run()
    assert "```output" not in page
    assert all(re.findall(r"^```text\n(.*?)^```$", page, re.DOTALL | re.MULTILINE)), "a block printed nothing"


def test_a_tutorial_that_fails_names_page_and_line(tmp_path: Path) -> None:
    page = tmp_path / "page.md"
    page.write_text("# Title\n\n```sh\nthirdbody solve no_such_scene.toml\n```\n", encoding="utf-8")
    with pytest.raises(TutorialFailed, match=r"page\.md:3: exit code 2"):
        Tutorial(page, tmp_path / "work").run()


@pytest.mark.slow
def test_the_tutorials_at_finite_strain_share_one_run(tmp_path: Path) -> None:
    pytest.importorskip("dolfinx")
    pytest.importorskip("meshio")
    for name in ("how_deep", "post_processing"):
        page = Tutorial(PAGES / "tutorials" / f"{name}.md", tmp_path).run()
        assert all(re.findall(r"^```text\n(.*?)^```$", page, re.DOTALL | re.MULTILINE))


@pytest.mark.slow
@pytest.mark.parametrize("name", ["own_law_or_body", "own_mesh"])
def test_a_tutorial_with_finite_elements_runs_as_printed(name: str, tmp_path: Path) -> None:
    pytest.importorskip("dolfinx")
    page = Tutorial(PAGES / "tutorials" / f"{name}.md", tmp_path).run()
    assert all(re.findall(r"^```text\n(.*?)^```$", page, re.DOTALL | re.MULTILINE))


def test_the_tutorial_of_nine_balls_gathers_them(tmp_path: Path) -> None:
    page = Tutorial(PAGES / "tutorials" / "nine_balls.md", tmp_path).run()
    assert "```output" not in page
    assert (tmp_path / "out" / "nine_balls-evolve-linear_bem" / "evolution.gif").stat().st_size > 0


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


def test_chebyshev_interpolation_is_exact_for_polynomials() -> None:
    axes = (Axis("x", 1.0, 3.0, "linear", 4), Axis("y", 0.5, 8.0, "log", 3))

    def f(x: Any, y: Any) -> Any:
        return (x**3 - x) * (1.0 + np.log(y) ** 2)

    values = f(axes[0].nodes()[:, None], axes[1].nodes()[None, :])
    for at in ((1.0, 0.5), (2.2, 3.0), (3.0, 8.0), (float(axes[0].nodes()[1]), 2.0)):
        assert interpolate(axes, values, at) == pytest.approx(f(*at), rel=1e-12)


def test_the_live_table_meets_the_solver_within_the_error_that_it_states() -> None:
    shipped = table.read()
    for at in ((0.48, 1.16, 2.0, 0.3), (0.5, 0.6, 2.2, 0.2), (0.3, 6.0, 3.0, 0.5), (0.1, 11.0, 7.5, 0.05)):
        stated = shipped.data["errors"][int(at[1] > table.BREAK)]["largest"]
        assert max(stated["tangential"], stated["normal"]) < 5e-3
        tangential, normal, section = table.difference(shipped, *at)
        assert tangential <= stated["tangential"]
        assert normal <= stated["normal"]
        assert section <= stated["section"]


def test_the_factors_of_the_live_page_are_the_published_ones() -> None:
    cases = widget.strengthening(widget.STUDY.read_text(encoding="utf-8"))
    thin = next(c for c in cases if (c["thickness"], c["distance"], c["poisson"]) == (1.16, 2.0, 0.48))
    assert [0.32, 1.2809, 0.0016] in thin["points"]
    assert len(cases) >= 14
    with pytest.raises(ValueError, match="thin layer"):
        widget.strengthening("# an empty page")


def test_the_live_page_is_small_and_needs_no_other_file() -> None:
    page = widget.html()
    assert len(page.encode()) < 1e6
    assert not re.findall(r"(?:src|href)=|https?://|fetch\(|import ", page)


SCRIPT = """<script>
const answers = [];
for (const values of %s) {
  document.getElementById("live").dispatchEvent(new CustomEvent("set-values", {detail: values}));
  const text = (name) => document.querySelector(`[data-shows="${name}"]`).textContent;
  answers.push({...JSON.parse(document.getElementById("live").dataset.values),
    shown: text("tangential"), kind: text("kind"), factor: text("strengthening")});
}
document.body.innerHTML = "<pre id=answers></pre>";
document.getElementById("answers").textContent = JSON.stringify(answers);
</script>"""


def in_browser(points: list[dict[str, float]], folder: Path) -> list[dict[str, Any]]:
    """Return what the live page computes and shows with its sliders at ``points``."""
    browser = headless_browser()
    if browser is None:
        pytest.skip("no headless browser here (apt-get install chromium-headless-shell)")
    page = folder / "live.html"
    script = SCRIPT % json.dumps(points)
    page.write_text(f"<!doctype html><meta charset=utf-8>{widget.html()}{script}", encoding="utf-8")
    options = ["--headless", "--no-sandbox", "--disable-gpu", "--no-first-run", "--disable-background-networking"]
    command = [browser, *options, f"--user-data-dir={folder / 'browser'}", "--dump-dom", page.as_uri()]
    done = subprocess.run(command, capture_output=True, text=True, check=True, timeout=120.0)
    found = re.search(r'<pre id="answers">(.*?)</pre>', done.stdout, re.DOTALL)
    assert found, done.stdout[-2000:]
    answers: list[dict[str, Any]] = json.loads(html.unescape(found[1]))
    return answers


def test_the_live_page_meets_the_solver_at_random_points_in_a_browser(tmp_path: Path) -> None:
    random = np.random.default_rng(7)
    shipped = table.read()
    points, scaled = [], []
    for poisson, thickness, distance, approach in table.random_points(8, seed=7):
        radius, young = float(random.uniform(0.5, 20.0)), float(random.uniform(0.05, 10.0))
        lengths = {"thickness": thickness * radius, "distance": distance * radius, "approach": approach * radius}
        points.append({"radius": radius, "young": young, "poisson": poisson, "friction": 0.3, **lengths})
        scaled.append((poisson, thickness, distance, approach))
    for answer, values, at in zip(in_browser(points, tmp_path), points, scaled, strict=True):
        assert answer["at"] == pytest.approx(at, rel=1e-9)
        unit = values["young"] * values["radius"] ** 2
        ball = solve_contact(table.pair(*at), 1e-4).result().balls[0]
        tangential, error = ball.tangential_force[0] * unit, ball.tangential_force_error * unit
        assert abs(answer["Q"] - ball.normal_force * unit) <= answer["normalError"]
        assert abs(answer["T"] - tangential) <= answer["error"] + error
        normal, by_table = shipped.pair_forces(*at)
        assert (answer["Q"], answer["T"]) == pytest.approx((normal * unit, by_table * unit), rel=1e-6)
        if abs(tangential) > 2.0 * answer["error"]:
            assert answer["kind"] == ("attraction" if tangential > 0.0 else "separation")


def test_the_live_page_shows_published_factors_and_no_others(tmp_path: Path) -> None:
    thin = {"radius": 2.0, "young": 1.0, "poisson": 0.48, "thickness": 2.32, "distance": 4.0, "approach": 0.64}
    known, unknown = in_browser([thin, {**thin, "thickness": 2.6}], tmp_path)
    assert known["factor"].startswith("1.281 ± 0.002")
    assert unknown["factor"] == "not known here"


def test_the_drift_of_the_live_page_is_that_of_the_forces(tmp_path: Path) -> None:
    nu, h, distance, approach = 0.3, 6.0, 3.0, 0.3
    values = {"poisson": nu, "thickness": h, "distance": distance, "approach": approach}
    (answer,) = in_browser([{"radius": 1.0, "young": 1.0, "friction": 0.3, **values}], tmp_path)
    steps = np.linspace(2.0, distance, 7)
    balls = [solve_contact(table.pair(nu, h, float(d), approach), 1e-3).result().balls[0] for d in steps]
    slowness = np.array([b.normal_force / (2.0 * b.tangential_force[0]) for b in balls])
    assert answer["drift"]["path"] == pytest.approx(float(simpson(slowness, x=steps)), rel=2e-3)


def test_a_tutorial_is_a_notebook_with_what_its_blocks_printed(tmp_path: Path) -> None:
    page = tmp_path / "page.md"
    page.write_text(
        "# Title\n\nSee [there](other.md) and {py:class}`X`.\n\n```toml\n# a.toml\nx = 1\n```\n\n"
        "```sh\ncat a.toml\n```\n\n```output\n```\n\n```python\nprint(6 * 7)\n```\n\n```output\n```\n\nEnd.\n",
        encoding="utf-8",
    )
    written = json.loads(notebook(Tutorial(page, tmp_path / "work").run()))
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


def test_the_page_of_validation_has_every_study_with_its_published_answer() -> None:
    rows = study_table().splitlines()[2:]
    assert [row.split("[")[1].split("]")[0] for row in rows] == list(STUDIES)
    published = (ROOT / "runs/studies/stability/README.md").read_text(encoding="utf-8")
    (said,) = (row.split(" | ")[1].removesuffix(" |") for row in rows if "[stability]" in row)
    assert said.startswith("Of ") and said in published.replace("**", "")  # noqa: PT018
