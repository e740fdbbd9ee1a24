"""The live page of the handbook meets the solver, in Python and in a browser."""

from __future__ import annotations

import html
import json
import math
import re
import subprocess
from itertools import chain, islice
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.integrate import simpson

from linear_bem import solve_contact
from runs.comparison.strengthening_fit import fit_error, strengthening_at_force
from runs.handbook.live import table, widget
from runs.handbook.live.chebyshev import Axis, interpolate
from tests.launch import headless_browser


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
        of_tangential, of_normal = shipped.data["error_of_kind"][table.kind(*at)]
        assert max(of_tangential, of_normal) < 2e-2
        tangential, normal, section = table.difference(shipped, at)
        assert tangential <= of_tangential
        assert normal <= of_normal
        assert section <= stated["section"]


def test_the_live_table_covers_its_corners_too() -> None:
    """Nearly incompressible or foam, deep, touching: up to 3.4 times the largest errors at random points."""
    shipped = table.read()
    for at in ((0.5, 1.15, 2.0, 0.5), (0.48, 0.5, 2.0, 0.22), (0.49, 0.7, 2.1, 0.3), (0.38, 1.1365, 2.01, 0.5)):
        assert np.all(table.difference(shipped, at)[:2] <= shipped.data["error_of_kind"][table.kind(*at)])


def test_saved_parts_of_the_table_are_those_of_its_axes(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(table, "CACHE", tmp_path)
    monkeypatch.setattr(table, "AROUND", Axis("distance from the contact", 0.0, 8.0, "sqrt", 2))
    for farthest in (8.0, 20.0):
        monkeypatch.setattr(table, "DISTANCE", Axis("distance", 2.0, farthest, "log", 1))
        found = table._of_depth(0.3, 2.0, 0.1)
        assert table._of_depth(0.3, 2.0, 0.1) == found
        normal = (
            solve_contact(table.pair(0.3, 2.0, math.sqrt(2.0 * farthest), 0.05), 1e-3).result().balls[0].normal_force
        )
        assert found["normal"] == pytest.approx([math.log(normal / table.hertz_force(0.3, 0.05))], abs=2e-4)


def test_the_factors_of_the_live_page_are_the_published_ones() -> None:
    cases = widget.strengthening(widget.STUDY.read_text(encoding="utf-8"))
    thin = next(c for c in cases if (c["thickness"], c["distance"], c["poisson"]) == (1.16, 2.0, 0.48))
    assert [0.32, 1.2818, 0.0025] in thin["points"]
    assert len(cases) >= 14
    with pytest.raises(ValueError, match="thin layer"):
        widget.strengthening("# an empty page")


def test_the_live_page_is_small_and_needs_no_other_file() -> None:
    page = widget.html()
    assert len(page.encode()) < 1e6
    assert not re.findall(r"(?:src|href)=|https?://|fetch\(|import ", page)


SCRIPT = """<script>
const answers = [];
for (const {fields, ...values} of %s) {
  for (const [name, value] of Object.entries(fields ?? {})) {
    const field = document.querySelector(`[data-shows="${name}-value"]`);
    field.value = value;
    field.dispatchEvent(new Event("change"));
  }
  document.getElementById("live").dispatchEvent(new CustomEvent("set-values", {detail: values}));
  const text = (name) => document.querySelector(`[data-shows="${name}"]`).textContent;
  answers.push({...JSON.parse(document.getElementById("live").dataset.values),
    shown: text("tangential"), share: text("share"), kind: text("kind"), factor: text("strengthening"),
    limited: text("limited")});
}
document.body.innerHTML = "<pre id=answers></pre>";
document.getElementById("answers").textContent = JSON.stringify(answers);
</script>"""
RANDOM = list(table.random_points(8, seed=7))
RADIUS, YOUNG = np.random.default_rng(7).uniform([0.5, 0.05], [20.0, 10.0], (8, 2)).T
FITTED = ((0.475, 1.05, 2.05, 0.3), (0.48, 1.19, 2.0, 0.41), (0.49, 7.0, 2.08, 0.2))
NOT_FITTED = ((0.46, 1.05, 2.05, 0.3), (0.475, 1.25, 2.05, 0.3), (0.475, 1.05, 2.2, 0.3), (0.475, 4.0, 2.05, 0.3))


def sliders(at: tuple[float, ...], radius: float, young: float = 1.0) -> dict[str, float]:
    poisson, *lengths = at
    sizes = dict(zip(("thickness", "distance", "approach"), (x * radius for x in lengths), strict=True))
    return {"radius": radius, "young": young, "poisson": poisson, "friction": 0.3, **sizes}


THIN = sliders((0.48, 1.16, 2.0, 0.32), 2.0)
FAR = {"radius": 0.5, "young": 0.02, "poisson": 0.0, "thickness": 0.25, "distance": 4.0, "approach": 0.11}
DRIFT = (0.3, 6.0, 3.0, 0.3)
Shown = dict[str, list[dict[str, Any]]]
POINTS: Shown = {
    "opened": [{}],
    "fields": [{"fields": {"thickness": "11", "poisson": "0.49"}}],
    "limits": [{"poisson": 0.7, "approach": 9.0}, {"poisson": 0.4}],
    "random": [sliders(*of) for of in zip(RANDOM, RADIUS, YOUNG, strict=True)],
    "published": [THIN, {**THIN, "thickness": 2.6}],
    "fit": [sliders(at, 2.0) for at in (*FITTED, *NOT_FITTED)],
    "small": [FAR, {**FAR, "distance": 1.0, "approach": 0.0022}],
    "drift": [sliders(DRIFT, 1.0)],
}


@pytest.fixture(scope="module")
def shown(tmp_path_factory: pytest.TempPathFactory) -> Shown:
    """What the live page computes and shows with its sliders at `POINTS`, one after the other."""
    browser = headless_browser()
    if browser is None:
        pytest.skip("no headless browser here (apt-get install chromium-headless-shell)")
    folder = tmp_path_factory.mktemp("live")
    page = folder / "live.html"
    script = SCRIPT % json.dumps(list(chain(*POINTS.values())))
    page.write_text(f"<!doctype html><meta charset=utf-8>{widget.html()}{script}", encoding="utf-8")
    options = ["--headless", "--no-sandbox", "--disable-gpu", "--no-first-run", "--disable-background-networking"]
    command = [browser, *options, f"--user-data-dir={folder / 'browser'}", "--dump-dom", page.as_uri()]
    done = subprocess.run(command, capture_output=True, text=True, check=True, timeout=120.0)
    found = re.search(r'<pre id="answers">(.*?)</pre>', done.stdout, re.DOTALL)
    assert found, done.stdout[-2000:]
    answers = iter(json.loads(html.unescape(found[1])))
    return {name: list(islice(answers, len(points))) for name, points in POINTS.items()}


def test_the_live_page_meets_the_solver_at_random_points_in_a_browser(shown: Shown) -> None:
    shipped = table.read()
    for answer, at, radius, young in zip(shown["random"], RANDOM, RADIUS, YOUNG, strict=True):
        assert answer["at"] == pytest.approx(at, rel=1e-9)
        unit = young * radius**2
        ball = solve_contact(table.pair(*at), 1e-3).result().balls[0]
        tangential, error = ball.tangential_force[0] * unit, ball.tangential_force_error * unit
        assert abs(answer["Q"] - ball.normal_force * unit) <= answer["normalError"]
        assert abs(answer["T"] - tangential) <= answer["error"] + error
        normal, by_table = shipped.pair_forces(*at)
        assert (answer["Q"], answer["T"]) == pytest.approx((normal * unit, by_table * unit), rel=1e-6)
        if abs(tangential) > 2.0 * answer["error"]:
            assert answer["kind"] == ("attraction" if tangential > 0.0 else "separation")


def test_the_live_page_shows_published_factors_and_no_others(shown: Shown) -> None:
    known, unknown = shown["published"]
    assert known["factor"] == "1.282 ± 0.003"
    assert unknown["factor"] == "not known here"


def test_the_live_page_shows_the_fit_of_plan_in_its_range_alone(shown: Shown) -> None:
    answers = shown["fit"]
    for (nu, h, L, d), answer in zip(FITTED, answers[:3], strict=True):
        assert answer["factor"].endswith(", by a fit")
        assert answer["S"]["factor"] == pytest.approx(strengthening_at_force(d, h, nu, L), rel=1e-6)
        assert answer["S"]["error"] == pytest.approx(fit_error(d, h, nu, L), rel=1e-6)
    assert {answer["factor"] for answer in answers[3:]} == {"not known here"}


def test_number_fields_set_values_exactly_and_t_has_the_sign_and_digits_of_its_kind_and_error(shown: Shown) -> None:
    (thin,), (exact,), (limited, free) = shown["opened"], shown["fields"], shown["limits"]
    assert exact["at"][:2] == [0.49, 11 / 2.5]
    assert thin["limited"] == ""
    assert limited["limited"] == "The table has no other value here: nu = 0.5, D = 1.25."
    assert free["limited"] == ""
    assert thin["kind"] == "separation"
    assert re.fullmatch(r"\u2212\d+(\.\d+)? \u00b1 \d+(\.\d+)? [mµn]?N", thin["shown"])
    value, error = thin["shown"].split(" ")[::2]
    assert len(value.partition(".")[2]) == len(error.partition(".")[2])


def test_forces_that_are_small_or_not_resolved_are_shown_in_few_digits(shown: Shown) -> None:
    unresolved, light = shown["small"]
    assert re.fullmatch(r"0 \u00b1 \d nN", unresolved["shown"])
    assert unresolved["share"] == "not resolved"
    assert re.fullmatch(r"\u22120\.\d{1,2} \u00b1 0\.\d{1,2} pN", light["shown"])
    assert re.fullmatch(r"\u2212\d(\.\d+)?e\u22127", light["share"])


def test_the_drift_of_the_live_page_is_that_of_the_forces(shown: Shown) -> None:
    (answer,) = shown["drift"]
    nu, h, distance, approach = DRIFT
    steps = np.linspace(2.0, distance, 3)
    balls = [solve_contact(table.pair(nu, h, float(d), approach), 1e-3).result().balls[0] for d in steps]
    slowness = np.array([b.normal_force / (2.0 * b.tangential_force[0]) for b in balls])
    assert answer["drift"]["path"] == pytest.approx(float(simpson(slowness, x=steps)), rel=2e-3)
