"""Map of the sign of T over thickness and distance by the point-load law, checked with the full solver."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from runs.display.style import checked_signs, feature, map_colors, panels
from runs.studies.figures.pair import Curve, Pair, at_features
from runs.studies.figures.part import Findings, Part
from runs.studies.figures.point_law import PointLaw, against_solver

EXPERIMENTS = {"16 mm": (1.25, True), "10 mm": (2.0, False), "7 mm": (20.0 / 7.0, False)}
"""Balls of the paper's section 2.2 on a 10 mm layer: h/R, and whether touching balls were separated."""
FINAL = 50.0 / 8.0
"""L/R at which, by the paper, the 16 mm balls stay; in the linear model they separate further."""
CHECKED = (
    (0.15, 2.0), (0.2, 2.0), (1.16, 2.0), (1.65, 2.0), (1.75, 2.0), (6.0, 2.0), (2.0, 3.0), (6.0, 6.5), (6.0, 7.5),
    (1.16, 12.0), (1.16, 14.0), (20.0, 15.0), (20.0, 30.0), (0.6, 6.0), (0.6, 8.0),
)  # fmt: skip
"""h', L' of points at which the full solver checks the law; five pairs of them lie on either side of a boundary."""


def compute(quick: bool) -> Findings:
    """Return T/T0 over (h', L'), the two critical values of L/h, and the check."""
    asked = at_features(quick)
    base = Pair().problem()
    assert base.substrate is not None
    law = PointLaw(base.layer.poisson, base.layer.young / base.substrate.young, base.substrate.poisson)
    lower, upper = law.sign_changes()
    h, distance = np.geomspace(0.05, 50.0, 60 if quick else 181), np.geomspace(2.0, 100.0, 40 if quick else 121)
    ratio = law.attraction(np.clip(distance[:, None] / h, 0.25, 400.0))

    def full(thickness: float, apart: float) -> float:
        bare = Pair(distance=apart, half_space=True).attraction(asked)
        return Pair(thickness=thickness, distance=apart).attraction(asked) / bare

    places = CHECKED[::3] if quick else CHECKED
    agreement, check = against_solver(("h", "L"), places, lambda h, distance: law.attraction(distance / h), full)
    roots = Curve(lambda h: Pair(thickness=h), [0.16, 0.19, 1.6, 1.8], asked).sign_changes()
    rigid = PointLaw(0.48, 1e-6)
    touching = {name: float(rigid.attraction(2.0 / thickness)) for name, (thickness, _) in EXPERIMENTS.items()}
    numbers = {
        "lower_L_over_h": float(lower),
        "upper_L_over_h": float(upper),
        "full_upper_at_contact": 2.0 / roots[0],
        "full_lower_at_contact": 2.0 / roots[1],
        **agreement,
        "experiments": touching,
        "as_seen": as_seen(touching),
        "share_left_at_rest": float(rigid.attraction(FINAL / 1.25) * 4.0 / FINAL**2 / rigid.attraction(2.0 / 1.25)),
    }
    grid = {"h": np.tile(h, distance.size), "L": np.repeat(distance, h.size), "T_over_half_space": ratio.ravel()}
    return Findings({"map": grid, "check": check}, numbers)


def as_seen(ratios: Mapping[str, float]) -> int:
    """Return for how many of the experiments the sign of T/T0 is that of what was seen."""
    return sum((ratios[name] < 0.0) == separated for name, (_, separated) in EXPERIMENTS.items())


def draw(found: Findings) -> Any:
    """Draw T/T0 with its zero lines, the points checked, and the experiments."""
    t, n = found.tables["map"], found.numbers
    h, distance = np.unique(t["h"]), np.unique(t["L"])
    values = np.reshape(t["T_over_half_space"], (distance.size, h.size))
    figure, (axes,) = panels(7.6, height=5.4)
    mesh = axes.pcolormesh(h, distance, values, shading="gouraud", rasterized=True, **map_colors())
    figure.colorbar(mesh, ax=axes, label="$T / T_0$,  $T_0$: half-space of the layer's material", extend="both")
    for key, start in (("lower_L_over_h", 11.0), ("upper_L_over_h", 3.3)):
        line = np.array([2.0 / n[key], 50.0])
        axes.plot(line, n[key] * line, color="black", lw=1.6)
        axes.annotate(
            f"T = 0 at $L = {n[key]:.3f}\\,h$", (start, n[key] * start), fontsize=10, rotation=47, ha="center",
            va="center", rotation_mode="anchor", xytext=(-6, 7), textcoords="offset points",
        )  # fmt: skip
    checked_signs(axes, [(c["h"], c["L"], c["full"]) for c in n["checks"]])
    for name, (thickness, separated) in EXPERIMENTS.items():
        seen = "separated" if separated else "stayed"
        offset = {"16 mm": (-34, -20), "10 mm": (4, -38), "7 mm": (26, -22)}[name]
        feature(axes, thickness, 2.0, f"{name}: {seen}", offset, marker="D", line="black")
    axes.plot([1.25, 1.25], [2.0, FINAL], color="black", lw=0.9, ls="--")
    feature(axes, 1.25, FINAL, "stayed", (12, 8), marker="D", line="black")
    for text, place in (("attraction", (9.0, 3.2)), ("separation", (0.62, 3.6)), ("attraction, weak", (0.14, 20.0))):
        axes.annotate(text, place, fontsize=12, style="italic", ha="center")
    axes.set(xscale="log", yscale="log", xlim=(0.05, 50.0), ylim=(1.1, 100.0))
    axes.axhspan(1.1, 2.0, color="white", zorder=1.5)
    axes.axhline(2.0, color="0.4", lw=0.8)
    axes.annotate("balls touch", (0.055, 1.8), fontsize=9, color="0.35")
    axes.set(xlabel="layer thickness $h' = h/R$", ylabel="distance $L' = L/R$")
    axes.set_title("Sign of T, $\\nu_1$ = 0.48, $E_1/E_2$ = 10$^{-3}$")
    axes.legend(loc="upper left", frameon=True, framealpha=0.85, edgecolor="none")
    return figure


PART = Part("map_lengths", "Map: sign of T over thickness and distance", compute, draw)
