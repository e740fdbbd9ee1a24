"""Figure 10: T over the layer's thickness, at a fixed force and at a fixed approach."""

from typing import Any

import numpy as np

from runs.display.style import BLUE, ORANGE, feature, panels, zero_line
from runs.studies.figures.pair import Curve, Pair, at_features, left_ball, line_through
from runs.studies.figures.part import Findings, Part

THINNEST = 0.05
"""Least h' at the fixed approach, and the left end of the axes."""


def compute(quick: bool) -> Findings:
    """Return T'(h') at the paper's force and at the approach due to this force on the half-space."""
    asked = at_features(quick)
    whole = left_ball(Pair(half_space=True), asked)
    limit, depth = whole.tangential_force[0], whole.approach
    thin = np.geomspace(0.03 if quick else 2e-3, 0.1, 3 if quick else 14)
    bends, levels = (12, 5) if quick else (64, 18)
    h = np.concatenate([thin[:-1], np.geomspace(0.1, 10.0, bends)[:-1], np.geomspace(10.0, 1000.0, levels)])

    force = Curve(lambda t: Pair(thickness=t), h, asked)
    # the approach must not reach the thickness of a thin layer: `THINNEST` is 3.7 times the approach
    deep = np.concatenate([np.geomspace(THINNEST, 0.1, 1 if quick else 8)[:-1], h[h >= 0.1]])
    approach = Curve(lambda t: Pair(thickness=t, approach=depth), deep, asked)
    bare = Pair(young=1000.0, poisson=0.3, half_space=True).attraction(asked)
    least, most = force.extremum(-1.0), approach.extremum(1.0)
    thinnest = h < 0.15
    top = int(np.argmax(force.values[thinnest]))
    hump = (h[top], force.values[top]) if quick else force.extremum(1.0, thinnest, exact=False)
    numbers = {
        "limit_thick": limit,
        "limit_thin": bare,
        "approach": depth,
        "sign_changes": force.sign_changes(),
        "h_of_minimum": least[0],
        "minimum": least[1],
        "at_thin": force(1.16),
        "at_thick": force(6.0),
        "rises_from_minimum_to": h[-1],
        "rises_everywhere": bool(np.all(np.diff(force.values[h > least[0]]) > 0.0)),
        "short_of_limit_by": 1.0 - np.max(force.values) / limit,
        "h_of_thin_hump": hump[0],
        "thin_hump": hump[1],
        "h_of_maximum_at_approach": most[0],
        "overshoot_at_approach": most[1] / limit - 1.0,
        "sign_changes_at_approach": approach.sign_changes(),
        "minimum_at_approach": approach.extremum(-1.0),
    }
    curves = {"force": force, "approach": approach}
    return Findings({name: {"h": curve.at, "T": curve.values} for name, curve in curves.items()}, numbers)


def draw(found: Findings) -> Any:
    """Draw T'(h') with its sign changes, extrema and limits; thin layers in a separate panel."""
    n = found.numbers
    figure, (main, thin) = panels(7.2, 4.6)
    for name, color, style, label, zeros in (
        ("approach", ORANGE, "--", f"fixed approach $D/R$ = {n['approach']:.5f}", n["sign_changes_at_approach"]),
        ("force", BLUE, "-", "fixed force $Q'$ = 2.66666 $\\times$ 10$^{-3}$ (the paper's)", n["sign_changes"]),
    ):
        table = found.tables[name]
        h, force = line_through(table["h"], table["T"], zeros)
        main.plot(h, 1e7 * force, style, color=color, label=label)
    zero_line(main)
    limit = 1e7 * n["limit_thick"]
    main.axhline(limit, color="0.5", lw=0.8, ls=":")
    main.annotate(f"half-space of the layer's material: {limit:.6f}", (0.055, limit + 0.1), fontsize=9, color="0.35")
    place, value = n["h_of_minimum"], 1e7 * n["minimum"]
    feature(main, place, value, f"minimum {value:.5f}\nat $h'$ = {place:.4f}", (-30, -8))
    for change, offset in zip(n["sign_changes"], ((4, 34), (24, -12)), strict=True):
        feature(main, change, 0.0, f"T = 0 at $h'$ = {change:.6f}", offset)
    peak = n["limit_thick"] * (1.0 + n["overshoot_at_approach"])
    words = f"maximum at fixed approach:\n+{100 * n['overshoot_at_approach']:.2f} % at $h'$ = "
    place = n["h_of_maximum_at_approach"]
    feature(main, place, 1e7 * peak, f"{words}{place:.2f}", (14, 22), ORANGE)
    main.set(xscale="log", xlim=(THINNEST, 200.0), ylim=(-2.2, 5.6), xlabel="layer thickness $h' = h/R$")
    main.set(ylabel="$10^7\\,T' = 10^7\\,T/(E_1 R^2)$", title="(a) T > 0: attraction, T < 0: separation")
    main.legend(loc="center right", bbox_to_anchor=(1.0, 0.42))
    thin.plot(h, 1e10 * force, color=BLUE)
    zero_line(thin)
    thin.axhline(1e10 * n["limit_thin"], color="0.5", lw=0.8, ls=":")
    thin.annotate(
        f"half-space of the substrate: {1e10 * n['limit_thin']:.4f}",
        (0.0023, 1e10 * n["limit_thin"] + 0.12), fontsize=9, color="0.35",
    )  # fmt: skip
    feature(
        thin, n["h_of_thin_hump"], 1e10 * n["thin_hump"],
        f"maximum {1e10 * n['thin_hump']:.4f}\nat $h'$ = {n['h_of_thin_hump']:.3f}", (-24, -34),
    )  # fmt: skip
    first = n["sign_changes"][0]
    feature(thin, first, 0.0, f"T = 0 at $h'$ = {first:.6f}", (-24, 16))
    thin.set(xscale="log", xlim=(2e-3, 0.3), ylim=(-2.0, 6.4), xlabel="$h'$", ylabel="$10^{10}\\,T'$")
    thin.set_title("(b) thin layers, fixed force")
    return figure


PART = Part("figure_10_thickness", "Figure 10: T over the layer's thickness", compute, draw)
