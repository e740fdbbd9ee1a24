"""What `solve` prints and saves of the errors of forces, approaches, peak pressures and areas."""

from __future__ import annotations

import csv
import json
from pathlib import Path

from linear_bem import Ball, Layer, Load, Problem, solve
from runs.commands.solve import solve_scene
from runs.display.tables import error_lines
from runs.reporting import page_of
from runs.reporting.folder import read_folder
from runs.scene.scene_file import read_scene
from runs.session.session import Options
from tests.launch import ROOT, thirdbody


def test_the_largest_relative_errors_are_one_line_and_columns_of_the_table(tmp_path: Path) -> None:
    scene = ROOT / "runs/scenes/paper_thin_pair_linear.toml"
    done = thirdbody("solve", scene, "--out", tmp_path / "out")
    assert done.returncode == 0, done.stderr
    assert "estimated errors: " in done.stdout
    with open(tmp_path / "out" / "steps.csv", encoding="utf-8", newline="") as file:
        row = next(csv.DictReader(file))
    assert 0.0 < float(row["peak_pressure_error"]) < 0.01 * float(row["peak_pressure"])


def test_what_is_prescribed_has_no_error_to_print() -> None:
    pair = (Ball((-1.0, 0.0), 1.0), Ball((1.0, 0.0), 1.0))
    problem = Problem(Layer(1.0, 0.48, 1.16), pair, Load("force", (0.01, 0.01)))
    balls = [ball.to_dict() for ball in solve(problem, 1e-3).balls]
    (line,) = error_lines(balls)
    assert line.startswith("estimated errors: D ")
    assert "peak pressure" in line
    assert error_lines([{"normal_force": 1.0}]) == []


def test_results_of_earlier_versions_say_that_they_lack_errors(tmp_path: Path) -> None:
    scene, out = read_scene(ROOT / "runs/scenes/paper_thin_pair_linear.toml"), tmp_path / "out"
    solve_scene(scene, None, Options(out=out))
    lacks = "without errors of peak pressure and contact area: --fresh has them"
    assert lacks not in page_of(read_folder(out))
    document = json.loads((out / "result.json").read_text(encoding="utf-8"))
    for ball in document["balls"]:
        del ball["errors"]["peak_pressure"], ball["errors"]["contact_area"]
    (out / "result.json").write_text(json.dumps(document), encoding="utf-8")
    assert lacks in page_of(read_folder(out))
    assert lacks in error_lines(document["balls"])[-1]
