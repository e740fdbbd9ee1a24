"""The report: one page that needs no other file, says what the run's JSON says, and fits a desk and a phone."""

from __future__ import annotations

import dataclasses
import html
import json
import re
import shutil
import subprocess
from collections import Counter
from html.parser import HTMLParser
from itertools import pairwise
from pathlib import Path

import pytest
from PIL import Image

from linear_bem.errors import OutputUnusable
from runs.commands.solve import solve_scene
from runs.reporting import page_of, report_folder
from runs.reporting.folder import Folder, read_folder
from runs.reporting.pictures import figure, pictures_of, said_of
from runs.scene.scene_file import read_scene
from runs.session.output_folder import MARK, RESULT
from runs.session.session import Options
from tests.launch import ROOT, STAND_IN, headless_browser, thirdbody

VOID = {"meta", "img", "br", "hr", "link", "input"}
BROWSER = headless_browser()
WIDTHS = 1280, 390
FLAGS = (
    "--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run", "--disable-component-update",
    "--disable-background-networking", "--disable-sync", "--virtual-time-budget=4000",
)  # fmt: skip


class Page(HTMLParser):
    """What a page holds: elements with their attributes, open elements around each, text of headings."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.elements: list[tuple[str, dict[str, str | None], tuple[str, ...]]] = []
        self.open: list[tuple[str, dict[str, str | None]]] = []
        self.faults: list[str] = []
        self.text: list[str] = []
        self.feed(text)
        self.close()
        self.faults += [f"<{name}> is not closed" for name, _ in self.open]

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.elements.append((tag, dict(attrs), tuple(f"{n}.{a.get('class', '')}" for n, a in self.open)))
        if tag not in VOID:
            self.open.append((tag, dict(attrs)))

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.elements.append((tag, dict(attrs), tuple(f"{n}.{a.get('class', '')}" for n, a in self.open)))

    def handle_endtag(self, tag: str) -> None:
        if not self.open or self.open[-1][0] != tag:
            self.faults.append(f"</{tag}> closes {self.open[-1][0] if self.open else 'nothing'}")
        else:
            self.open.pop()

    def handle_data(self, data: str) -> None:
        self.text.append(data)

    def all(self, *tags: str) -> list[dict[str, str | None]]:
        return [attributes for tag, attributes, _ in self.elements if tag in tags]


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """Folders of a solved scene, a comparison and a study, each with its report."""
    base = tmp_path_factory.mktemp("report")
    made = {name: base / name for name in ("solve", "compare", "study")}
    scene = base / "scene.toml"
    given = (ROOT / "runs/scenes/paper_thin_pair_linear.toml").read_text(encoding="utf-8")
    scene.write_text(re.sub(r'title = ".*"', 'title = "<script>alert(1)</script> & co"', given), encoding="utf-8")
    commands = {
        "solve": ("solve", scene),
        "compare": ("compare", "tests/runs/light_pair.toml"),
        "study": ("study", "strengthening", "--quick", "--shard", "1/4"),
    }
    for name, folder in made.items():
        done = thirdbody(*commands[name], "--out", folder, program=STAND_IN)
        assert done.returncode == 0, done.stderr
        done = thirdbody("report", folder)
        assert done.returncode == 0, done.stderr
        assert "report.html" in done.stderr
    return made


@pytest.mark.parametrize("name", ["solve", "compare", "study"])
def test_the_page_is_whole_and_needs_no_other_file(name: str, runs: dict[str, Path]) -> None:
    text = (runs[name] / "report.html").read_text(encoding="utf-8")
    page = Page(text)
    assert not page.faults
    assert not page.all("script", "link", "iframe", "object", "embed", "base")
    for attributes in page.all("img", "a", "use", "image", "source"):
        for key, value in attributes.items():
            if key in ("src", "href", "xlink:href", "srcset"):
                assert (value or "").startswith(("#", "data:image/")), f"{key}={value}"
    assert "@import" not in text
    assert all(target.startswith("#") for target in re.findall(r"url\(([^)]*)\)", text))
    ids = Counter(attributes["id"] for _, attributes, _ in page.elements if "id" in attributes)
    assert not [name for name, count in ids.items() if count > 1]
    for target in re.findall(r'(?:xlink:)?href="#([^"]+)"', text):
        assert target in ids


@pytest.mark.parametrize("name", ["solve", "compare", "study"])
def test_the_page_can_be_read_without_seeing_it(name: str, runs: dict[str, Path]) -> None:
    page = Page((runs[name] / "report.html").read_text(encoding="utf-8"))
    assert page.all("html")[0]["lang"] == "en"
    assert any(attributes.get("name") == "viewport" for attributes in page.all("meta"))
    headings = [int(tag[1]) for tag, _, _ in page.elements if re.fullmatch("h[1-6]", tag)]
    assert headings.count(1) == 1
    assert all(after <= before + 1 for before, after in pairwise(headings))
    assert all((attributes.get("alt") or "").strip() for attributes in page.all("img"))
    for tag, attributes, around in page.elements:
        if tag == "svg":
            assert attributes.get("role") == "img"
            assert attributes.get("aria-label")
            assert any(outer.startswith("div.picture") for outer in around)
        if tag == "table":
            assert "div.scroll" in around
        if tag == "div" and "scroll" in (attributes.get("class") or ""):
            assert attributes.get("tabindex") == "0"
            assert attributes.get("aria-label")


def test_the_pages_say_what_the_runs_found(runs: dict[str, Path]) -> None:
    document = json.loads((runs["compare"] / "result.json").read_text(encoding="utf-8"))
    page = Page((runs["compare"] / "report.html").read_text(encoding="utf-8"))
    text = " ".join(page.text)
    assert document["answer"] in text
    assert "Light pair: two touching balls" in text
    assert "poisson = 0.48" in text
    assert "thirdbody compare" in text
    assert f"{document['comparison'][0]['approach']:.4g}" in text
    assert len(page.all("svg")) == 1  # T over the load, as vectors
    assert len(page.all("img")) == 1  # the surface, which is a raster picture
    linear = " ".join(Page((runs["solve"] / "report.html").read_text(encoding="utf-8")).text)
    found = json.loads((runs["solve"] / "result.json").read_text(encoding="utf-8"))
    assert f"{found['balls'][0]['normal_force']:.4g}" in linear
    assert "numpy" in linear
    assert "--model linear_bem" in linear
    study = Page((runs["study"] / "report.html").read_text(encoding="utf-8"))
    words = " ".join(study.text)
    assert "thirdbody study strengthening --quick" in words
    assert "not run yet" in words  # the other shard
    assert len(study.all("svg")) == 3


def test_what_a_user_writes_cannot_become_markup(runs: dict[str, Path], tmp_path: Path) -> None:
    assert thirdbody("report", runs["solve"], "--out", tmp_path / "page.html").returncode == 0
    text = (tmp_path / "page.html").read_text(encoding="utf-8")
    assert not Page(text).all("script")
    assert "&lt;script&gt;alert(1)&lt;/script&gt; &amp; co" in text


def test_an_evolution_is_shown_by_its_tables_though_no_model_knows_pressures(tmp_path: Path) -> None:
    ball = {
        "position": [0.0, 0.0], "radius": 1.0, "approach": 0.1, "normal_force": 0.1, "tangential_force": [1e-3, 0.0],
        "tangential_force_error": 1e-5, "peak_pressure": None, "contact_area": None, "tangential_force_routes": {},
    }  # fmt: skip
    solved = {"seconds": 1.0, "ranks": 1, "iterations": 3, "unknowns": 4, "notes": ["forces by pairs"]}
    solved["versions"] = {"numpy": "1.24"}
    more = {
        "ensemble": [{"seed": 1, "groups": 2, "cycles_end": 4.5}, {"seed": 2, "groups": 1, "cycles_end": 3.5}],
        "events": [{"cycle": 0.5, "sigma": 2.0, "pair": [0, 3], "kind": "touch"}], "rest": {"force_over_load": 0.03},
        "sentences": ["at rest after 4.5 cycles: 3 contacts hold the balls"],
    }  # fmt: skip
    problem = {"balls": [{"radius": 1.0}], "layer": {"young": 1.0}}
    identity = {"command": "evolve", "model": "point_load", "problem": problem}
    (tmp_path / MARK).write_text(json.dumps({"identity": identity, "state": "running"}))
    document = {"balls": [ball], "steps": [], "solved": solved, **more}
    (tmp_path / "result.json").write_text(json.dumps(document))
    page = Page(page_of(read_folder(tmp_path)))
    assert not page.faults
    text = " ".join(page.text)
    for words in ("normal force Q", "seed", "balls in clusters", "Note: forces by pairs", "1.24", "unfinished"):
        assert words in text
    assert "State at the last saved moment" in text
    assert "steps" in page.text  # not iterations
    assert not {"iterations", "unknowns"} & set(page.text)
    for words in ("0, 3", "touch"):
        assert words in text
    for words in ("at rest after 4.5 cycles", "sliding path over friction / R", "cycles at the end"):
        assert words in text
    assert not any(words in text for words in ("contact radius", "sigma", "force over load"))


def test_an_edited_comparison_is_named_and_a_page_may_go_into_a_new_folder(
    runs: dict[str, Path], tmp_path: Path
) -> None:
    out = tmp_path / "new" / "folder" / "page.html"
    report_folder(runs["compare"], out)
    assert out.read_text(encoding="utf-8") == (runs["compare"] / "report.html").read_text(encoding="utf-8")
    with pytest.raises(OutputUnusable, match=r"cannot be made: .*; name another --out"):
        report_folder(runs["compare"], out / "page.html")
    folder = shutil.copytree(runs["compare"], tmp_path / "edited")
    document = json.loads((folder / RESULT).read_text(encoding="utf-8"))
    first = document["comparison"][0]
    first |= {key: str(value) for key, value in first.items() if key.startswith("strengthening")}
    (folder / RESULT).write_text(json.dumps(document), encoding="utf-8")
    with pytest.raises(OutputUnusable, match=r"result\.json: has a wrong value .*edited.*--fresh"):
        report_folder(folder, None)


def test_two_figures_of_one_page_do_not_share_names(tmp_path: Path) -> None:
    used = '<use xlink:href="#a" clip-path="url(#a)"/>'
    (tmp_path / "x.svg").write_text(f'<?xml version="1.0"?><svg viewBox="0 0 4 1" width="4pt"><g id="a"/>{used}</svg>')
    first, second = (figure(tmp_path / "x.svg", number, 'shows "x"') for number in (1, 2))
    assert 'id="figure1-a"' in first
    assert 'href="#figure2-a"' in second
    assert "url(#figure2-a)" in second
    assert 'class="picture wide"' in first
    assert "shows &quot;x&quot;" in first


def test_a_photograph_beside_a_run_is_a_figure(tmp_path: Path) -> None:
    Image.new("RGB", (8, 4)).save(tmp_path / "rig.jpg")
    (photograph,) = pictures_of(tmp_path)
    assert '<img src="data:image/jpeg;base64,' in figure(photograph, 1)


def test_a_rendered_picture_says_what_it_shows() -> None:
    drawn = Path("run/pictures/von_mises_cut_step_0007.png")
    assert said_of(drawn) == "Von Mises stress in the deformed layer under its balls: cut, load step 7."
    moving = Path("run/pictures/contact_pressure_surface.gif")
    assert said_of(moving).startswith("Contact pressure in the deformed layer under its balls: surface, along the load")
    assert said_of(Path("run/surface.png")).startswith("Contact pressure on the layer's surface")
    assert said_of(Path("run/anything_else.png")) == "Anything else"


def test_many_balls_have_a_page_with_the_largest_of_them(tmp_path: Path) -> None:
    places = ", ".join(f"[{3 * (k % 11)}, {3 * (k // 11)}]" for k in range(121))
    (tmp_path / "many.toml").write_text(
        f"[layer]\nthickness = 2\nyoung = 1\npoisson = 0.3\n[balls]\nradius = 1\npositions = [{places}]\n"
        "[load]\napproach = 0.05\n[accuracy]\ntangential_force = 0.1\n",
        encoding="utf-8",
    )
    solve_scene(read_scene(tmp_path / "many.toml"), None, Options(False, tmp_path / "out", False))
    page = Page(page_of(read_folder(tmp_path / "out")))
    assert not page.faults
    text = " ".join(" ".join(page.text).split())
    assert re.search(
        r"Asked for: 10 % of the largest tangential force; reached: [\d.]+ % \(met\)\. \d+ of the balls", text
    )
    assert "the 20 largest T of 121 balls, descending; result.json has all" in text
    assert len(page.all("tr")) < 40


def test_the_accuracy_asked_and_reached_is_shown_with_its_meshes(tmp_path: Path) -> None:
    state = {
        "position": [0.0, 0.0], "radius": 1.0, "approach": 0.1, "normal_force": 0.1, "tangential_force": [0.0, 0.0],
        "tangential_force_error": 0.0, "peak_pressure": 1.0, "contact_area": 0.1,
    }  # fmt: skip
    meshes = [{"order": 3, "fineness": 1.5, "extent": 1.0, "unknowns": 9648, "reached": None, "seconds": 5.0}]
    accuracy = {
        "asked": 0.02,
        "reached": 0.031,
        "terms": {"discretisation": 0.03, "enforcement": 1e-4, "transfer": 0.0078, "solver": 1e-6},
        "met": False,
        "stopped": "the budget of 60 000 unknowns",
        "meshes": meshes,
    }
    solved = {"seconds": 1.0, "ranks": 1, "iterations": 3, "unknowns": 7, "notes": [], "accuracy": accuracy}
    problem = {"balls": [{"radius": 1.0}], "layer": {"young": 1.0}}
    (tmp_path / MARK).write_text(
        json.dumps(
            {"identity": {"command": "solve", "model": "finite_strain", "problem": problem}, "state": "finished"}
        )
    )
    (tmp_path / "result.json").write_text(json.dumps({"balls": [state], "steps": [], "solved": solved}))
    text = " ".join(Page(page_of(read_folder(tmp_path))).text)
    assert "Asked for: 2 % of the largest tangential force; reached: 3.1 % (not met)." in text
    assert "The run ended because: the budget of 60 000 unknowns." in text
    assert "9 648" in text
    assert "discretisation 3 %, contact enforcement 0.01 %, transfer of the small-strain correction 0.78 %" in text
    assert "order 3, fineness 1.5" in text
    older = {**solved, "accuracy": {"requested": 0.02, "reached": 0.01}}
    (tmp_path / "result.json").write_text(json.dumps({"balls": [state], "steps": [], "solved": older}))
    with pytest.raises(OutputUnusable, match=r"result\.json: lacks the key 'asked', perhaps .* with --fresh"):
        page_of(read_folder(tmp_path))


@dataclasses.dataclass(frozen=True)
class Seen:
    """What a browser makes of a page: by how much it is wider than its window, and how high its pictures are."""

    hidden: int
    pictures: list[float]


def seen(page: Path, scratch: Path) -> dict[int, Seen]:
    """Lay the page out in frames as wide as a desk's and a phone's window in headless Chromium."""
    frames = ""
    for width in WIDTHS:
        script = (
            f"const d = document.getElementById('f{width}').contentDocument;"
            f"document.body.dataset.seen{width} = JSON.stringify({{"
            "hidden: d.documentElement.scrollWidth - d.documentElement.clientWidth,"
            "pictures: [...d.querySelectorAll('.picture svg, .picture img')].map("
            "e => e.getBoundingClientRect().height)})"
        )
        frames += (
            f'<iframe id="f{width}" style="border:0;width:{width}px;height:900px" onload="{script}" '
            f'srcdoc="{html.escape(page.read_text(encoding="utf-8"))}"></iframe>'
        )
    (scratch / "frames.html").write_text(f'<body style="margin:0">{frames}', encoding="utf-8")
    assert BROWSER is not None
    profile = f"--user-data-dir={scratch / 'profile'}"
    command = [BROWSER, *FLAGS, profile, "--dump-dom", f"file://{scratch / 'frames.html'}"]
    shown = subprocess.run(command, capture_output=True, text=True, timeout=120, check=True).stdout
    found = dict(re.findall(r'data-seen(\d+)="([^"]*)"', shown))
    assert len(found) == len(WIDTHS), shown[-500:]
    return {int(width): Seen(**json.loads(html.unescape(answer))) for width, answer in found.items()}


@pytest.mark.skipif(BROWSER is None, reason="no Chromium here: the structure is tested above, the layout is not")
@pytest.mark.parametrize(("name", "pictures"), [("compare", 2), ("study", 3)])
def test_a_browser_shows_the_page_without_sideways_scrolling(
    name: str, pictures: int, runs: dict[str, Path], tmp_path: Path
) -> None:
    for width, found in seen(runs[name] / "report.html", tmp_path).items():
        assert found.hidden == 0, width
        assert len(found.pictures) == pictures
        assert min(found.pictures) > 100.0


@pytest.mark.parametrize(
    ("command", "model"), [("solve", " --model point_load"), ("evolve", " --model point_load"), ("compare", "")]
)
def test_the_command_that_reproduces_a_run_names_its_model(command: str, model: str) -> None:
    folder = Folder(Path("out/x"), {"command": command, "model": "point_load"}, "finished", {}, "", "")
    assert folder.repeat() == f"thirdbody {command} out/x/scene.toml{model} --out NEW_FOLDER"
    spaced = dataclasses.replace(folder, path=Path("my out/x"))
    assert spaced.repeat() == f"thirdbody {command} 'my out/x/scene.toml'{model} --out NEW_FOLDER"
