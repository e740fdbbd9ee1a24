"""Figure 10: T over the layer's thickness, at a fixed force and at a fixed approach."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from typing import Any

import numpy as np

from runs.display.style import BLUE, ORANGE, feature, panels, zero_line
from runs.studies.figures.pair import CURVES, Pair, at_features, extremum, sign_changes
from runs.studies.figures.part import Findings, Part

REFERENCE = {1.16: -1.161292e-7, 6.0: 4.098673e-7, np.inf: 4.362335e-7}
"""T' at h' of an independent computation, good to 1e-5; sign changes at h' = 0.171697 and 1.697711."""
CHANGES = (0.171697, 1.697711)


def compute(quick: bool) -> Findings:
    """Return T'(h') at the paper's force and at the approach that this force makes on the half-space."""
    asked = at_features(quick)
    whole = Pair(half_space=True).left(asked)
    limit, depth = whole.tangential_force[0], whole.approach
    thin = np.geomspace(2e-3, 0.1, 5 if quick else 14)
    bends, levels = (12, 9) if quick else (64, 18)
    h = np.concatenate([thin[:-1], np.geomspace(0.1, 10.0, bends)[:-1], np.geomspace(10.0, 1000.0, levels)])

    def at_force(thickness: float, accuracy: float = asked) -> float:
        return Pair(thickness=thickness).attraction(accuracy)

    def at_approach(thickness: float, accuracy: float = asked) -> float:
        return Pair(thickness=thickness, approach=depth).attraction(accuracy)

    drawn_force, drawn_approach = partial(at_force, accuracy=CURVES), partial(at_approach, accuracy=CURVES)
    force = np.array([drawn_force(float(t)) for t in h])
    # a thin layer at this approach would be squeezed to nothing: from ten times its depth on
    wide = h[h > 10.0 * depth]
    approach = np.array([drawn_approach(float(t)) for t in wide])
    bare = Pair(young=1000.0, poisson=0.3, half_space=True).attraction(asked)
    least, most = extremum(at_force, h, force, -1.0), extremum(at_approach, wide, approach, 1.0)
    thick = h > least[0]
    thinnest = h < 0.15
    top = int(np.argmax(force[thinnest]))
    hump = (h[top], force[top])
    if not quick:
        hump = extremum(drawn_force, h[thinnest], force[thinnest], 1.0)
    numbers = {
        "limit_thick": limit,
        "limit_thin": bare,
        "approach": depth,
        "sign_changes": sign_changes(at_force, h, force, drawn_force),
        "h_of_minimum": least[0],
        "minimum": least[1],
        "at_thin": at_force(1.16),
        "at_thick": at_force(6.0),
        "rises_from_minimum_to": float(h[-1]),
        "rises_everywhere": bool(np.all(np.diff(force[thick]) > 0.0)),
        "short_of_limit_by": float(1.0 - np.max(force) / limit),
        "h_of_thin_hump": hump[0],
        "thin_hump": hump[1],
        "h_of_maximum_at_approach": most[0],
        "overshoot_at_approach": most[1] / limit - 1.0,
        "sign_changes_at_approach": sign_changes(at_approach, wide, approach, drawn_approach),
        "minimum_at_approach": extremum(at_approach, wide, approach, -1.0),
    }
    tables = {
        "force": {"h": h.tolist(), "T": force.tolist()},
        "approach": {"h": wide.tolist(), "T": approach.tolist()},
    }
    return Findings({**tables}, numbers)


def draw(found: Findings) -> Any:
    """Draw T'(h') with its sign changes, extrema and limits; the thin end apart."""
    n = found.numbers
    figure, (main, thin) = panels(7.2, 4.6)
    for name, color, style, label in (
        ("approach", ORANGE, "--", f"fixed approach $D/R$ = {n['approach']:.5f}"),
        ("force", BLUE, "-", "fixed force $Q'$ = 2.66666e-3 (the paper's)"),
    ):
        table = found.tables[name]
        main.plot(table["h"], 1e7 * np.array(table["T"]), style, color=color, label=label)
    zero_line(main)
    limit = 1e7 * n["limit_thick"]
    main.axhline(limit, color="0.5", lw=0.8, ls=":")
    main.annotate(f"half-space of the layer's material: {limit:.6f}", (0.055, limit + 0.1), fontsize=9, color="0.35")
    feature(main, n["h_of_minimum"], 1e7 * n["minimum"], _named("minimum", n["h_of_minimum"], n["minimum"]), (-30, -8))
    for change, offset in zip(n["sign_changes"], ((4, 34), (24, -12)), strict=True):
        feature(main, change, 0.0, f"T = 0 at $h'$ = {change:.6f}", offset)
    peak = n["limit_thick"] * (1.0 + n["overshoot_at_approach"])
    words = f"maximum at fixed approach:\n+{100 * n['overshoot_at_approach']:.2f} % at $h'$ = "
    place = n["h_of_maximum_at_approach"]
    feature(main, place, 1e7 * peak, f"{words}{place:.2f}", (14, 22), ORANGE)
    main.set(xscale="log", xlim=(0.05, 200.0), ylim=(-2.2, 5.6), xlabel="layer thickness $h' = h/R$")
    main.set(ylabel="$10^7\\,T' = 10^7\\,T/(E_1 R^2)$", title="(a) T > 0: attraction, T < 0: separation")
    main.legend(loc="center right", bbox_to_anchor=(1.0, 0.42))
    table = found.tables["force"]
    thin.plot(table["h"], 1e10 * np.array(table["T"]), color=BLUE)
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


def _named(what: str, place: float, value: float) -> str:
    return f"{what} {1e7 * value:.5f}\nat $h'$ = {place:.4f}"


def sentences(n: Mapping[str, Any]) -> list[str]:
    """Return what the figure shows, and where it agrees with the paper's text."""
    first, second = n["sign_changes"]
    return [
        f"At fixed force: T' = {n['limit_thin']:.4e} at h' = 0, sign changes at h' = {first:.6f} and {second:.6f}, "
        f"minimum {n['minimum']:.6e} at h' = {n['h_of_minimum']:.4f}, T'(1.16) = {n['at_thin']:.6e}, T'(6) = "
        f"{n['at_thick']:.6e}, T'(inf) = {n['limit_thick']:.6e}.",
        "Agrees: a very small attraction without a layer, separation with a minimum for thin layers, attraction again "
        "for thick ones, towards the half-space's value.",
        f"Differs: the paper describes a thickness at which the attraction exceeds that of the half-space. At fixed "
        f"force there is none: from the minimum to h' = {n['rises_from_minimum_to']:g} T' "
        f"{'rises at every step' if n['rises_everywhere'] else 'does not rise everywhere'}, and stays "
        f"{n['short_of_limit_by']:.0e} below the limit.",
        f"At fixed approach (D/R = {n['approach']:.6f}, which the force makes on the half-space) there is one: "
        f"+{100.0 * n['overshoot_at_approach']:.2f} % at h' = "
        f"{n['h_of_maximum_at_approach']:.2f}; sign changes at h' = "
        + " and ".join(f"{c:.6f}" for c in n["sign_changes_at_approach"])
        + f", minimum {n['minimum_at_approach'][1]:.4e} at h' = {n['minimum_at_approach'][0]:.4f}. A thinner layer "
        "then carries more force, and T grows with its square: the experiments fix the approach.",
        f"Not in the paper: before it falls, T' rises by {100.0 * (n['thin_hump'] / n['limit_thin'] - 1.0):.2f} % over "
        f"its value without a layer (at h' = {n['h_of_thin_hump']:.3f}).",
    ]


PART = Part("figure_10_thickness", "Figure 10: T over the layer's thickness", compute, draw, sentences)
