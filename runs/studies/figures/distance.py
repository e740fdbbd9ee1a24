"""Figure 12: T over the distance between the balls, on a thin and on a thick layer."""

from typing import Any

import numpy as np

from runs.display.style import BLUE, ORANGE, feature, panels, zero_line
from runs.studies.figures.pair import Curve, Pair, at_features, line_through
from runs.studies.figures.part import Columns, Findings, Part

LAYERS = {"thin": 1.16, "thick": 6.0}


def compute(quick: bool) -> Findings:
    """Return T'(L') on both layers with sign changes, extrema, and T far away over T on a half-space."""
    asked = at_features(quick)
    distance = np.geomspace(2.0, 300.0, 12 if quick else 90)
    tables, numbers = dict[str, Columns](), dict[str, Any]()
    for name, thickness in LAYERS.items():
        force = Curve(lambda d, h=thickness: Pair(thickness=h, distance=d), distance, asked)  # type: ignore[misc]
        near, changes = force(2.0), force.sign_changes()
        numbers[name] = {
            "thickness": thickness,
            "at_contact": near,
            "sign_changes": changes,
            "sign_changes_over_h": [c / thickness for c in changes],
            "extremum_beyond": force.extremum(1.0 if near < 0.0 else -1.0, distance > changes[0]),
            "left_at_5": force(5.0) / near,
            "left_at_10": force(10.0) / near,
        }
        tables[name] = {"L": distance, "T": force.values}
    # T L^2 far away over that of a half-space of the substrate
    bare = Pair(distance=2.0, young=1000.0, poisson=0.3, half_space=True).attraction(asked) * 4.0
    farthest = tables["thin"]["T"][-1] * distance[-1] ** 2 / bare
    numbers["far"] = {"T_L_squared_over_substrate": farthest, "at": distance[-1]}
    return Findings(tables, numbers)


def draw(found: Findings) -> Any:
    """Draw T'(L') near contact on linear axes, and |T'| far away on logarithmic ones."""
    figure, (near, far) = panels(6.0, 6.0)
    for name, color, style in (("thick", BLUE, "-"), ("thin", ORANGE, "--")):
        table, n = found.tables[name], found.numbers[name]
        x, y = line_through(table["L"], table["T"], n["sign_changes"], power=2.0)
        near.plot(x, 1e7 * y, style, color=color, label=f"$h'$ = {n['thickness']:g}")
        for attracts, line in ((True, "-"), (False, ":")):
            part = np.where((y > 0.0) == attracts, np.abs(y), np.nan)
            word = "attraction" if attracts else "separation"
            far.loglog(x, part, line, color=color, label=f"$h'$ = {n['thickness']:g}, {word}")
        start = 1e7 * n["at_contact"]
        feature(near, 2.0, start, f"{start:.5f}", (14, -8 if start < 0 else 4), color)
    zero_line(near)
    thick, thin = found.numbers["thick"], found.numbers["thin"]
    feature(near, thick["sign_changes"][0], 0.0, f"T = 0 at $L'$ = {thick['sign_changes'][0]:.4f}", (6, 30), BLUE)
    place, value = thick["extremum_beyond"]
    feature(near, place, 1e7 * value, f"minimum {1e7 * value:.4f} at $L'$ = {place:.3f}", (-6, -30), BLUE)
    near.set(xlim=(1.8, 14.0), ylim=(-1.5, 4.5), xlabel="distance $L' = L/R$", ylabel="$10^7\\,T'$")
    near.set_title("(a) T > 0: attraction, T < 0: separation")
    near.legend(loc="upper right")
    floor = 1e-14
    for n, color in ((thick, BLUE), (thin, ORANGE)):
        for change in n["sign_changes"]:
            far.axvline(change, ymax=0.06, color=color, lw=1.2)
            far.annotate(
                f"{change:.4g}", (change, 2.2 * floor), xytext=(5, 0), textcoords="offset points", color=color,
                fontsize=9, ha="left", bbox={"fc": "white", "ec": "none", "pad": 1.0},
            )  # fmt: skip
    far.set(xlim=(1.9, 300.0), ylim=(floor, 2e-6), xlabel="distance $L' = L/R$", ylabel="$|T'|$")
    far.set_title("(b) far away; ticks at the sign changes")
    far.legend(loc="upper right")
    return figure


PART = Part("figure_12_distance", "Figure 12: T over the distance", compute, draw)
