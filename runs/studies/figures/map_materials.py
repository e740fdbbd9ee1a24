"""Map of the sign of T over Poisson's ratio and modulus of the layer by the point-load law, checked."""

from typing import Any

import numpy as np
from scipy.optimize import brentq

from runs.display.style import checked_signs, feature, map_colors, panels
from runs.studies.figures.pair import Pair, at_features, halved
from runs.studies.figures.part import Findings, Part
from runs.studies.figures.point_law import PointLaw, against_solver

THICKNESS, DISTANCE = 1.16, 2.0
CHECKED = (
    (0.0, 1e-3), (0.2, 1e-3), (0.23, 1e-3), (0.26, 1e-3), (0.3, 1e-3), (0.48, 1e-3), (0.5, 1e-5), (0.3, 0.1),
    (0.4, 0.05), (0.48, 0.1), (0.48, 0.2), (0.48, 0.25), (0.48, 1.0), (0.1, 5.0),
)  # fmt: skip
"""nu1, E1/E2 of points at which the full solver checks the law; some lie on either side of the boundary."""


def compute(quick: bool) -> Findings:
    """Return T/T0 at h' = 1.16, L' = 2 and the nearest L/h of separation over (nu1, E1/E2), and the check."""
    asked = at_features(quick)
    poisson = np.linspace(0.0, 0.5, 7 if quick else 41)
    ratio = np.geomspace(1e-5, 10.0, 9 if quick else 61)
    rho = DISTANCE / THICKNESS
    force, lower, upper = (np.full((poisson.size, ratio.size), np.nan) for _ in range(3))
    for i, nu in enumerate(poisson):
        for j, r in enumerate(ratio):
            law = PointLaw(float(nu), float(r))
            force[i, j] = law.attraction(rho)
            changes = law.sign_changes()
            if changes.size:
                lower[i, j], upper[i, j] = changes[0], changes[1] if changes.size > 1 else np.inf

    def full(nu: float, r: float) -> float:
        return Pair(poisson=nu, ratio=r).attraction(asked) / Pair(poisson=nu, half_space=True).attraction(asked)

    places = CHECKED[::3] if quick else CHECKED
    agreement, check = against_solver(
        ("nu1", "E1_over_E2"), places, lambda nu, r: PointLaw(nu, r).attraction(rho), full
    )
    numbers = {
        "ratio_without_separation": {f"{nu:g}": _largest_ratio(nu) for nu in (0.0, 0.3, 0.4, 0.48, 0.5)},
        "lower_at_poisson": {f"{nu:g}": float(PointLaw(nu, 1e-3).sign_changes()[0]) for nu in (0.0, 0.3, 0.48, 0.5)},
        **agreement,
        "poisson_at_zero": brentq(lambda nu: PointLaw(nu, 1e-3).attraction(rho), 0.1, 0.4, xtol=1e-6),
        "poisson_at_zero_full": brentq(lambda nu: Pair(poisson=nu).attraction(asked), 0.2, 0.3, xtol=1e-6),
    }
    grid = {
        "nu1": np.repeat(poisson, ratio.size),
        "E1_over_E2": np.tile(ratio, poisson.size),
        "T_over_half_space": force.ravel(),
        "lower_L_over_h": lower.ravel(),
        "upper_L_over_h": upper.ravel(),
    }
    limit = {"nu1": poisson, "E1_over_E2": np.array([_largest_ratio(float(nu)) for nu in poisson])}
    return Findings({"map": grid, "limit": limit, "check": check}, numbers)


def _largest_ratio(poisson: float) -> float:
    """Return E1/E2 beyond which balls attract at every distance."""
    low, high = halved(-3.0, 1.0, 14, lambda power: PointLaw(poisson, 10.0**power).sign_changes().size > 0)
    return float(10.0 ** (0.5 * (low + high)))


def draw(found: Findings) -> Any:
    """Draw T/T0 at one distance and thickness, and the least L/h at which balls separate."""
    t, n = found.tables["map"], found.numbers
    nu, ratio = np.unique(t["nu1"]), np.unique(t["E1_over_E2"])

    def grid(key: str) -> Any:
        return np.reshape(np.array(t[key], dtype=float), (nu.size, ratio.size)).T

    figure, (force, reach) = panels(6.4, 6.4, height=5.0)
    mesh = force.pcolormesh(nu, ratio, grid("T_over_half_space"), shading="gouraud", rasterized=True, **map_colors())
    figure.colorbar(mesh, ax=force, label="$T / T_0$", extend="both")
    force.contour(nu, ratio, grid("T_over_half_space"), [0.0], colors="black", linewidths=1.6)
    checked_signs(force, [(c["nu1"], c["E1_over_E2"], c["full"]) for c in n["checks"]])
    feature(force, n["poisson_at_zero_full"], 1e-3, f"$\\nu_1$ = {n['poisson_at_zero_full']:.4f}", (-28, -22))
    force.set_title("(a) $h'$ = 1.16, $L'$ = 2: sign of T")
    force.annotate("separation", (0.39, 8e-5), fontsize=12, style="italic", ha="center")
    force.annotate("attraction", (0.12, 8e-3), fontsize=12, style="italic", ha="center")
    force.legend(loc="lower left", frameon=True, framealpha=0.85, edgecolor="none")
    reach.set_yscale("log")  # labels of contours are placed for the axes as they are now
    limit = np.array(found.tables["limit"]["E1_over_E2"])
    lower, upper = (_continued(grid(key)) for key in ("lower_L_over_h", "upper_L_over_h"))
    filled = reach.contourf(nu, ratio, lower, np.linspace(1.1, 2.6, 31), cmap="cividis_r", extend="max")
    figure.colorbar(filled, ax=reach, label="least $L/h$ at which balls separate", ticks=np.arange(1.2, 2.7, 0.2))
    lines = reach.contour(nu, ratio, lower, [1.2, 1.4, 1.6, 1.8, 2.0], colors="black", linewidths=0.9)
    reach.clabel(lines, fontsize=9, fmt="%.1f")
    lines = reach.contour(nu, ratio, upper, [4.0, 6.0, 8.0, 12.0], colors="white", linewidths=1.1, linestyles="--")
    reach.clabel(lines, fontsize=9, fmt="%g")
    reach.fill_between(nu, limit, 10.0, color="white", zorder=2.5)
    reach.plot(nu, limit, color="black", lw=1.6, zorder=3)
    reach.set_title("(b) Balls separate between two distances $L/h$:\nfrom the black lines' to the white dashed lines'")
    reach.annotate("attraction at every distance", (0.25, 1.6), fontsize=12, style="italic", ha="center", zorder=4)
    for axes in (force, reach):
        axes.set(yscale="log", xlabel="Poisson's ratio of the layer $\\nu_1$", ylabel="$E_1 / E_2$")
        axes.set(xlim=(0.0, 0.5), ylim=(1e-5, 10.0))
    return figure


def _continued(values: Any) -> Any:
    """Return values over (E1/E2, nu1), continued beyond the last E1/E2 with a value, so that contours reach it."""
    out = values.copy()
    for column in out.T:
        known = np.flatnonzero(np.isfinite(column))
        if known.size:
            column[known[-1] + 1 : known[-1] + 3] = column[known[-1]]
            column[: known[-1]][~np.isfinite(column[: known[-1]])] = 1e3  # no end of the separation
    return out


PART = Part("map_materials", "Map: sign of T over Poisson's ratio and modulus", compute, draw)
