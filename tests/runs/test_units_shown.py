"""Numbers for people are in the units of the scene, and R and the balls are identified."""

from __future__ import annotations

import dataclasses
import html
import io
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest
from rich.console import Console

from linear_bem import Ball, Load
from linear_bem.result import BallResult, Result, Solved
from runs.commands.plan import plan_scene
from runs.commands.solve import _show as show_solution
from runs.display import figures, plan_words, tables
from runs.display.numbers import Scale, bodies
from runs.display.rows import ball_rows, legend_of_balls, path_rows
from runs.models import choose
from runs.process import exit_codes
from runs.process.exit_codes import run_to_end
from runs.reporting import page_of
from runs.reporting.folder import Folder
from runs.reporting.run_page import _state
from runs.scene import units
from runs.scene.scene_file import InvalidScene, Scene, read_scene
from runs.scene.units import Unit, Units

SCENE = """title = "unlike \\u001b[31mballs [red]"
[layer]
thickness = "3 mm"
young = "57.4 kPa"
poisson = 0.49
[balls]
radius = ["2.5 mm", "4 mm"]
positions = [["-4 mm", 0], ["4 mm", 0]]
[load]
force = "500 mN"
"""


def scene(folder: Path, text: str = SCENE) -> Scene:
    path = folder / "scene.toml"
    path.write_text(text, encoding="utf-8")
    return read_scene(path)


def balls(read: Scene) -> list[BallResult]:
    state, errors = (0.3e-3, 0.5, (1e-3, 0.0), 1e-6, 2e4, 1e-5), {"peak_pressure": 1e3}
    return [BallResult(ball.position, ball.radius, *state, errors=errors) for ball in read.problem.balls]


def test_units_are_those_of_the_scene(tmp_path: Path) -> None:
    units = Units.written(scene(tmp_path).data)
    assert units == Units(Unit("mm", 1e-3), Unit("mN", 1e-3), Unit("kPa", 1e3))
    assert units.pressure(57.4e3) == "57.4 kPa"
    assert Units.written({"title": "5 m", "layer": {"young": 2e5}}) is None


@pytest.mark.parametrize("unit", units.SIZES)
def test_the_sizes_of_common_units_are_those_of_pint(unit: str) -> None:
    for name, size in units.SIZES[unit].items():
        assert (1.0 * units._units().parse_units(name)).to(unit).magnitude == size, name
        assert units.quantity(f"7 {name}", unit) == 7.0 * size


def test_a_modulus_without_its_unit_beside_lengths_with_theirs_is_noted(tmp_path: Path) -> None:
    forgotten = SCENE.replace('"57.4 kPa"', "57.4").replace('"500 mN"', '"0.1 mN"')
    _, _, notes = choose(scene(tmp_path, forgotten))
    assert notes == ("[layer] young: 57.4 Pa is softer than foam and rubber; did you mean kPa or MPa?",)
    assert choose(scene(tmp_path))[2] == ()
    plain = SCENE.replace('"57.4 kPa"', "1.0")
    for written, bare in (('"3 mm"', "3"), ('["2.5 mm", "4 mm"]', "[1, 4]"), ('"-4 mm"', "-4"), ('"4 mm"', "4")):
        plain = plain.replace(written, bare)
    assert choose(scene(tmp_path, plain.replace('"500 mN"', "1")))[2] == ()


def test_a_plan_doubts_units_before_all_else(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", "200")  # one line each
    soft = scene(tmp_path, SCENE.replace('"57.4 kPa"', '"57.4 mPa"').replace('"500 mN"', '"0.1 uN"'))
    plan_scene(soft, None, as_json=False, advises=False)
    first, second = capsys.readouterr().out.splitlines()[:2]
    assert first.startswith("unlike")
    assert second == "warning: [layer] young: 0.0574 Pa is softer than foam and rubber; did you mean kPa or MPa?"


def test_lengths_without_a_unit_beside_others_with_theirs_are_noted(tmp_path: Path) -> None:
    _, _, notes = choose(scene(tmp_path, SCENE.replace('["2.5 mm", "4 mm"]', "[0.0025, 0.004]")))
    note = "is in metres, as it has no unit; other lengths are in mm"
    assert notes == (f"[balls] radius = 0.0025 {note}",)
    with pytest.raises(InvalidScene) as caught:
        scene(tmp_path, SCENE.replace('["2.5 mm", "4 mm"]', "[2.5, 4]"))
    assert caught.value.faults[1:] == (f"a possible cause: [balls] radius = 2.5 {note}",)


def test_balls_of_metres_beside_values_with_units_are_noted(tmp_path: Path) -> None:
    huge = SCENE
    for written, bare in (('"3 mm"', "3"), ('["2.5 mm", "4 mm"]', "[2.5, 4]"), ('"-4 mm"', "-4"), ('"4 mm"', "4")):
        huge = huge.replace(written, bare)
    doubt = "[balls] radius = 4 is in metres, as it has no unit; other values have units: did you mean mm?"
    assert choose(scene(tmp_path, huge))[2] == (doubt,)
    assert tables.warnings({"notes": [doubt]}) == [f"warning: {doubt}"]
    assert choose(scene(tmp_path, huge.replace("thickness = 3", 'thickness = "3 m"')))[2] == ()  # metres are meant


def test_a_scene_in_plain_numbers_is_dimensionless_only_if_radius_and_modulus_are_one() -> None:
    assert Scale.from_numbers([1.0, 1.0], 1.0).dimensionless
    assert Scale.from_numbers([1.0], 2.0).units == Units()
    assert not Scale.from_numbers([1.0], 1.0, {"layer": {"thickness": "2 m"}}).dimensionless
    unlike = Scale.from_numbers([1.0, 0.5], 1.0).legend()
    assert unlike == "R: radius of ball 0, E: Young's modulus of the layer; both are 1 in this scene"


def test_tables_have_the_scenes_units_and_identify_the_balls(tmp_path: Path) -> None:
    read = scene(tmp_path)
    scale = Scale.of(read.problem, read.data)
    second = ball_rows([ball.to_dict() for ball in balls(read)], scale)[1]
    assert second["radius [mm]"] == pytest.approx(4.0)
    assert second["D [mm]"] == pytest.approx(0.3)
    assert second["D / R"] == pytest.approx(0.3 / 2.5)
    assert second["Q [mN]"] == pytest.approx(500.0)
    assert second["peak p [kPa]"] == pytest.approx(20.0)
    assert scale.legend() == "R = 2.5 mm: radius of ball 0; E = 57.4 kPa: Young's modulus of the layer"
    assert bodies(read.problem, scale) == "sphere, radius 2.5 mm; sphere, radius 4 mm"
    sizes = [Ball((20e-3 * place, 0.0), radius) for place, radius in enumerate((2e-3, 2.5e-3, 4e-3, 3e-3))]
    many = dataclasses.replace(read.problem, balls=tuple(sizes), load=Load("force", (0.1,) * 4))
    assert bodies(many, scale) == "sphere of 4 sizes, radii 2 mm to 4 mm"


@pytest.mark.parametrize("width", [80, 200])
def test_headings_keep_their_units_at_any_width(width: int, tmp_path: Path) -> None:
    read, text = scene(tmp_path), io.StringIO()
    out = Console(file=text, width=width)
    tables.show_balls(out, [ball.to_dict() for ball in balls(read)], Scale.of(read.problem, read.data), read.title)
    assert "[mm]" in text.getvalue()
    assert "[red]" in text.getvalue()  # the title's, which is no markup
    assert ("D / R" in text.getvalue()) == (width == 200)
    assert max(map(len, text.getvalue().splitlines())) <= width


def test_a_table_of_many_balls_shows_the_largest_forces(tmp_path: Path) -> None:
    read, text = scene(tmp_path), io.StringIO()
    many = [dict(balls(read)[i % 2].to_dict()) for i in range(tables.MANY + 1)]
    for i, ball in enumerate(many):
        ball["tangential_force"] = [1e-6 * (1 + (37 * i) % len(many)), 0.0]
    shown = sorted(range(len(many)), key=lambda i: -((37 * i) % len(many)))[: tables.SHOWN]
    tables.show_balls(Console(file=text, width=200), many, Scale.of(read.problem, read.data), "many")
    printed = text.getvalue()
    assert "the 20 largest T of 101 balls, descending; result.json has all" in printed
    first = [line.split()[0] for line in printed.splitlines() if line.split()]
    assert [int(word) for word in first if word.isdigit()] == shown


def test_a_plan_gives_the_domain_in_the_scenes_unit() -> None:
    sides = {"x": [0.0, 0.012], "layer": 0.003, "substrate": 0.0}
    assert plan_words.domain(sides, Unit("mm", 1e-3)) == "domain [mm]: x 0 to 12, layer 3, substrate 0"
    assert plan_words.domain({"layer": 1.16}, Units.length) == "domain [m]: layer 1.16"


def test_in_a_periodic_cell_t_over_q_is_a_size(tmp_path: Path) -> None:
    read = scene(tmp_path)
    found = [ball.to_dict() for ball in balls(read)]
    left, right = ball_rows(found, Scale.of(read.problem, read.data | {"periodic": {}}))
    assert left["|T| / Q"] == right["|T| / Q"] == pytest.approx(2e-3)
    assert "T / Q" not in left


def test_a_load_path_in_a_cell_does_not_depend_on_which_images_give_the_positions(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    read, titles = scene(tmp_path), []
    monkeypatch.setattr(figures, "save_figure", lambda figure, *_: titles.append(figure.axes[0].get_title("left")))
    for x in (-4e-3, 20e-3):  # the first ball on either side of the second
        found = [ball.to_dict() for ball in balls(read)]
        found[0]["position"] = (x, 0.0)
        steps = [{"balls": found}, {"balls": [ball | {"tangential_force": [2e-3, 0.0]} for ball in found]}]
        scale = Scale.of(read.problem, read.data | {"periodic": {}})
        rows = path_rows(steps, 0, scale)
        assert [row["T / Q"] for row in rows] == pytest.approx([2e-3, 4e-3])
        figures.draw_path(tmp_path, steps, scale, "linear_bem")
    assert titles == ["T here: the component along T at full load"] * 2


@pytest.mark.parametrize("across", [True, False])
def test_a_load_path_says_where_its_t_is_not_that_towards_the_other_ball(
    across: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("COLUMNS", "200")  # one line each
    read = scene(tmp_path)
    found = [ball.to_dict() | {"tangential_force": [1e-4, 2e-3 * across]} for ball in balls(read)]
    document = {"model": "linear_bem", "balls": found, "steps": [{"balls": found}] * 2}
    session = SimpleNamespace(problem=read.problem, scene=read, scale=Scale.of(read.problem, read.data))
    show_solution(session, document | {"solved": Solved(True, 1, 1, 1.0).to_dict()})  # type: ignore[arg-type]
    printed = capsys.readouterr().out
    assert ("T here: the component along T at full load" in printed) is across
    assert printed.count("T > 0: towards the other balls") == 1


def test_the_balls_with_the_largest_t_are_named_by_its_size_not_by_its_part_along_one_line(tmp_path: Path) -> None:
    text = SCENE.replace('["2.5 mm", "4 mm"]', '"2 mm"').replace('[["-4 mm", 0],', '[[0, "9 mm"], ["-4 mm", 0],')
    read = scene(tmp_path, text)
    scale, found = Scale.of(read.problem, read.data), [ball.to_dict() for ball in balls(read)]
    found[0]["tangential_force"] = [3e-3, 0.0]  # across the line to the others
    assert ball_rows(found, scale)[0]["T / Q"] == pytest.approx(0.0)
    facts = _state(found, 0, scale, {})
    assert facts["tangential force |T|"] == "3.0000 ± 0.0010 mN"  # neither attraction nor separation
    assert facts["T known to"] == "0.033 %"
    (row,) = path_rows([{"balls": found}], 0, scale)
    assert row["T / Q"] == pytest.approx(6e-3)
    *_, meaning, largest = legend_of_balls(found, scale)
    assert "line to the centre of the other balls" in meaning
    assert largest.startswith("largest |T|: ball 0 (3 mN), ball 1 (1 mN)")
    assert [line.startswith("T > 0") for line in legend_of_balls(found[:2], scale)] == [True]
    assert legend_of_balls(found[:1], scale) == []


def test_a_title_commands_no_terminal(tmp_path: Path) -> None:
    assert scene(tmp_path).title == "unlike  [31mballs [red]"


def test_the_report_has_the_scenes_units_and_names_the_ball(tmp_path: Path) -> None:
    read = scene(tmp_path)
    solved = Solved(True, 1, 1, 1.0, accuracy={"asked": 0.01, "reached": 0.03, "stopped": "budget", "terms": {}})
    result = Result("finite_strain", tuple(balls(read)), solved)
    identity = {
        "command": "solve",
        "problem": {"balls": [{"radius": b.radius} for b in read.problem.balls], "layer": {"young": 57.4e3}},
    }
    page = page_of(Folder(tmp_path, identity, True, result.to_dict(read.data), SCENE, ""))
    page = page[page.index("</style>") :]
    for words in ("0.3 mm (0.12 R)", "500 mN", "its radius", "R = 2.5 mm: radius of ball 0", "Q [mN]", "peak p [kPa]"):
        assert words in page, words
    # one number for what is known of T, above and below: the largest error over the balls
    assert "20.0 ± 1.0 kPa" in page
    assert page.count("3 %") == 2
    assert "0.1 %" not in page  # of the ball shown alone
    # T that nearly vanishes is not known to a share of another force
    document = result.to_dict(read.data)
    document["solved"]["accuracy"]["relative_to"] = {"what": "a tenth of the force between the balls", "force": 1.0}
    page = page_of(Folder(tmp_path, identity, True, document, SCENE, ""))
    assert "<dd>0.1 %" in page
    assert "Asked for: 1 % of a tenth of the force between the balls; reached: 3 % (not met)" in page
    # a single ball has no T
    mesh = {"order": 2, "fineness": 1.0, "unknowns": 10, "seconds": 1.0, "reached": 0.03}
    document["solved"]["accuracy"] |= {"relative_to": {"what": "the approach"}, "meshes": [mesh]}
    page = page_of(Folder(tmp_path, identity, True, document, SCENE, ""))
    assert "errors of D are relative to the approach" in page
    assert "error of D [%]" in page


def test_the_report_on_several_balls_says_what_the_sign_of_t_means(tmp_path: Path) -> None:
    text = SCENE.replace('["2.5 mm", "4 mm"]', '"2 mm"').replace('[["-4 mm", 0],', '[[0, "9 mm"], ["-4 mm", 0],')
    read = scene(tmp_path, text)
    result = Result("linear_bem", tuple(balls(read)), Solved(True, 1, 1, 1.0))
    document = result.to_dict(read.data)
    document["balls"][0]["tangential_force"] = [3e-3, 0.0]  # across the line to the others
    identity = {"command": "solve", "problem": {"balls": [{"radius": 2e-3}] * 3, "layer": {"young": 57.4e3}}}
    page = html.unescape(page_of(Folder(tmp_path, identity, True, document, text, "")))
    assert page.count("<p>T > 0: towards the other balls (attraction)") == 1
    assert "<p>largest |T|: ball 0 (3 mN)" in page


class Full(io.StringIO):
    """A standard output on a full device."""

    def flush(self) -> None:
        raise OSError(28, "No space left on device")


def test_a_standard_output_that_cannot_be_written_is_one_message(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(exit_codes.signals, "listen", lambda: None)
    monkeypatch.setattr(sys, "stdout", Full())
    with pytest.raises(SystemExit) as ended:
        run_to_end(lambda: 0)
    sys.stdout.close()
    assert ended.value.code == 2
    assert capsys.readouterr().err.startswith("thirdbody: error: standard output: cannot be written: No space left")


def test_an_encoding_without_our_characters_gets_question_marks(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(exit_codes.signals, "listen", lambda: None)
    raw = io.BytesIO()
    monkeypatch.setattr(sys, "stdout", io.TextIOWrapper(raw, encoding="ascii"))
    with pytest.raises(SystemExit) as ended:
        run_to_end(lambda: print("1.0 \u00b1 0.1") or 0)
    assert not ended.value.code
    assert raw.getvalue() == b"1.0 ? 0.1\n"


def test_notes_on_missing_units_come_before_the_numbers_and_others_after() -> None:
    early = "[layer] thickness = 4 is in metres, as it has no unit; other lengths are in mm"
    late = "[finite_strain] left out by --model linear_bem"
    solved = {"notes": [late, early]}
    assert tables.warnings(solved) == [f"warning: {early}"]
    assert tables.notes(solved) == [f"note: {late}"]
