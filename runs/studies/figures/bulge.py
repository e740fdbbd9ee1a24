"""Figure 8: place and size of the surface bulge beside a uniformly loaded square."""

from dataclasses import replace
from typing import Any

import numpy as np
from scipy.optimize import brentq, minimize

from linear_bem import Elastic, Layer, deepest_bulge, uniform_square_displacement
from runs.display.style import BLUE, ORANGE, feature, panels, zero_line
from runs.studies.figures.pair import extremum, halved, scene
from runs.studies.figures.part import Findings, Part

REFERENCE = 1.0
"""h/a of an independent computation; its x*/a and w* E1/(a q) are in the text of the figure."""
OFF_AXIS = 1e-3
"""y*/a beyond which the deepest bulge has left the axis."""


def _solids(thickness: float) -> tuple[Layer, Elastic | None]:
    base = scene().problem
    return replace(base.layer, thickness=thickness), base.substrate


def on_axis(thickness: float) -> tuple[float, float]:
    """Return x*/a and w* on the axis y = 0 for h/a = ``thickness``."""
    return deepest_bulge(*_solids(thickness))


def anywhere(thickness: float) -> tuple[float, float, float]:
    """Return x*/a, y*/a and w* of the deepest bulge beside the edge x = a, anywhere on the surface."""
    layer, substrate = _solids(thickness)

    def displacement(place: Any) -> float:
        x, y = 1.0 + np.exp(place[0]), place[1]
        return float(uniform_square_displacement(layer, substrate, 1.0, 1.0, x, y)) * layer.young

    axis = np.log(on_axis(thickness)[0] - 1.0)
    scan = np.linspace(0.0, 1.0, 26)
    start = scan[int(np.argmin([displacement((axis, y)) for y in scan]))]
    found = minimize(
        displacement, (axis, start), method="Nelder-Mead", options={"xatol": 1e-6, "fatol": 1e-14, "maxfev": 200}
    )
    return 1.0 + float(np.exp(found.x[0])), abs(float(found.x[1])), float(found.fun)


def compute(quick: bool) -> Findings:
    """Return w*, x* over h/a on the axis, the deepest bulge off the axis for thin layers, and their features."""
    thickness = np.geomspace(0.011, 20.0, 19 if quick else 70)
    axis = np.array([on_axis(float(h)) for h in thickness])
    leaves = 0.5 * sum(halved(0.05, 0.12, 5 if quick else 12, lambda h: anywhere(h)[1] > OFF_AXIS))
    near = leaves * (1.0 - np.linspace(0.0, 1.0, 5 if quick else 14)[1:] ** 2)  # y* starts like a square root
    thin = np.sort(np.concatenate([near[near > 0.02], [0.015, leaves, 1.1 * leaves, 1.25 * leaves]]))
    surface = np.array([anywhere(float(h)) for h in thin])
    deepest = extremum(lambda h: on_axis(h)[1], thickness, axis[:, 1], -1.0)
    x_ref, w_ref = on_axis(REFERENCE)
    numbers = {
        "h_over_a_of_deepest": deepest[0],
        "deepest_w": deepest[1],
        "x_of_deepest": on_axis(deepest[0])[0],
        "x_at_reference": x_ref,
        "w_at_reference": w_ref,
        "h_over_a_off_axis_below": leaves,
        "h_over_a_no_bulge_below": _vanishing(),
        "x_minus_one_over_h_thin": (on_axis(0.1)[0] - 1.0) / 0.1,
        "x_over_h_thick": on_axis(200.0)[0] / 200.0,
        "y_at_thinnest": surface[0, 1],
        "thinnest": thin[0],
        "off_axis_gain_at_thinnest": surface[0, 2] / on_axis(float(thin[0]))[1] - 1.0,
    }
    on_the_axis = dict(zip(("h_over_a", "x_over_a", "w_E1_over_a_q"), (thickness, *axis.T), strict=True))
    off = dict(zip(("h_over_a", "x_over_a", "y_over_a", "w_E1_over_a_q"), (thin, *surface.T), strict=True))
    return Findings({"axis": on_the_axis, "anywhere": off}, numbers)


def _vanishing() -> float:
    """Return h/a at which the deepest point on the axis is level with the unloaded surface."""

    def lowest(thickness: float) -> float:
        layer, substrate = _solids(thickness)
        x = 1.0 + thickness * np.linspace(0.3, 0.9, 60)
        return float(np.min(uniform_square_displacement(layer, substrate, 1.0, 1.0, x))) * layer.young

    return float(brentq(lowest, 0.005, 0.02, rtol=1e-5))


def draw(found: Findings) -> Any:
    """Draw w* and x* over h/a, and the place of the deepest bulge for thin layers."""
    axis, off, n = found.tables["axis"], found.tables["anywhere"], found.numbers
    figure, (depth, place, side) = panels(4.6, 4.0, 4.0)
    depth.plot(axis["h_over_a"], axis["w_E1_over_a_q"], color=BLUE)
    zero_line(depth)
    h0, hd, hc = n["h_over_a_no_bulge_below"], n["h_over_a_of_deepest"], n["h_over_a_off_axis_below"]
    feature(depth, hd, n["deepest_w"], f"deepest: {n['deepest_w']:.5f}\nat $h/a$ = {hd:.4f}", (22, -6))
    feature(depth, h0, 0.0, f"no bulge below\n$h/a$ = {h0:.5f}", (4, -62))
    feature(depth, 1.0, n["w_at_reference"], f"$h/a$ = 1: {n['w_at_reference']:.6f}", (24, 20), marker="s")
    depth.set(xscale="log", xlabel="$h / a$", ylabel="$w^* E_1 / (a q)$", title="(a) depth of the bulge, on the axis")
    depth.set_xlim(0.008, 20.0)
    depth.set_ylim(-0.068, 0.004)
    place.plot(axis["h_over_a"], axis["x_over_a"], color=BLUE)
    place.plot(axis["h_over_a"], [1.0 + n["x_minus_one_over_h_thin"] * h for h in axis["h_over_a"]], "--", color="0.5")
    place.annotate(f"thin: 1 + {n['x_minus_one_over_h_thin']:.3f} $h/a$", (4.2, 2.2), fontsize=9, color="0.35")
    feature(place, 1.0, n["x_at_reference"], f"$h/a$ = 1: {n['x_at_reference']:.6f}", (24, -10), marker="s")
    place.annotate(f"thick: $x^*$ = {n['x_over_h_thick']:.3f} $h/a$", (4.6, 6.6), fontsize=9, color=BLUE, ha="right")
    place.set(xlabel="$h / a$", ylabel="$x^* / a$", title="(b) its place, on the axis", xlim=(0, 10), ylim=(0, 12.5))
    side.plot(off["h_over_a"], off["y_over_a"], "o-", color=ORANGE, ms=4)
    side.axvline(hc, color="0.5", lw=0.8, ls="--")
    side.annotate(f"on the axis\nfrom $h/a$ = {hc:.4f}", (hc - 0.003, 0.88), fontsize=9, ha="right")
    side.set(xlabel="$h / a$", ylabel="$y^* / a$", title="(c) its distance from the axis, thin layers", xlim=(0, 0.125))
    side.set_ylim(-0.03, 1.0)
    return figure


PART = Part("figure_8_bulge", "Figure 8: bulge beside a loaded square", compute, draw)
