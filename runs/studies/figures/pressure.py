"""Figure 9: contact pressure under both balls, and its asymmetry."""

from typing import Any

import numpy as np

from linear_bem import Solution, solve_contact
from runs.display.style import BLUE, ORANGE, PURPLE, feature, panels, zero_line
from runs.studies.figures.pair import Pair, halved
from runs.studies.figures.part import Findings, Part


def compute(quick: bool) -> Findings:
    """Return p'(xi) under the left and the right ball on their common axis, xi from each ball's own axis."""
    solution = solve_contact(Pair().problem(), 1e-6)
    left, right = solution.result().balls
    radius = float(np.sqrt(left.contact_area / np.pi))
    inner, outer = (_edge(solution, left.position[0], side, radius) for side in (1.0, -1.0))
    reach, count = max(inner, outer), 81 if quick else 321
    # pressures end like square roots: points are denser towards both edges, and between the edges
    side = reach * np.sin(np.linspace(0.0, 0.5 * np.pi, count))
    side = np.unique(np.concatenate([side, np.linspace(min(inner, outer), reach, 12), [1.04 * reach, 1.08 * reach]]))
    xi = np.concatenate([-side[:0:-1], side])
    young = solution.problem.layer.young
    p = [solution.pressure(ball.position[0] + xi, np.zeros_like(xi)) / young for ball in (left, right)]
    difference = p[0] - p[1]
    largest = int(np.argmax(difference))
    peak = left.peak_pressure / young
    numbers = {
        "peak_pressure": peak,
        "peak_pressure_of_hertz_on_same_area": 1.5 * left.normal_force / left.contact_area,
        "contact_radius": radius,
        "inner_edge": inner,
        "outer_edge": outer,
        "difference_at_nine_tenths": float(np.interp(0.9 * reach, xi, difference)),
        "largest_difference": float(difference[largest]),
        "largest_difference_over_peak": float(difference[largest] / peak),
        "at": float(xi[largest]),
        "antisymmetry": float(np.max(np.abs(difference + difference[::-1])) / np.max(difference)),
        "one_sign": bool(np.all(difference[xi > 0.0] >= -1e-12 * peak)),
        "mutual": left.tangential_force_routes["mutual"][0],
        "slope": left.tangential_force_routes["slope"][0],
        "on_right": right.tangential_force[0],
        "over_normal_force": left.tangential_force[0] / left.normal_force,
        "error": left.tangential_force_error,
    }
    table = {"xi": xi, "p_left": p[0], "p_right": p[1], "difference": difference}
    return Findings({"pressure": table}, numbers)


def _edge(solution: Solution, centre: float, side: float, radius: float) -> float:
    """Return the extent of the contact from the ball's axis to one side."""

    def pressed(distance: float) -> bool:
        return bool(solution.pressure(np.array([centre + side * distance]), np.zeros(1))[0] > 0.0)

    return halved(0.9 * radius, 1.1 * radius, 40, pressed)[0]


def draw(found: Findings) -> Any:
    """Draw both pressures and their difference."""
    t, n = found.tables["pressure"], found.numbers
    figure, (both, difference) = panels(5.4, 5.8)
    both.plot(t["xi"], t["p_left"], color=BLUE, lw=3.0, label="left ball")
    both.plot(t["xi"], t["p_right"], "--", color=ORANGE, label="right ball")
    feature(both, 0.0, n["peak_pressure"], f"peak {n['peak_pressure']:.6f}", (18, 9))
    both.annotate(f"contact radius {n['contact_radius']:.6f}", (0.0, 0.008), ha="center", fontsize=9)
    both.legend(loc="center")
    both.set(xlabel="$x / R$ from the ball's own axis", ylabel="$p / E_1$", title="(a) contact pressure, $y = 0$")
    both.set_ylim(0.0, 1.15 * n["peak_pressure"])
    difference.plot(t["xi"], 1e6 * np.array(t["difference"]), color=PURPLE)
    zero_line(difference)
    place = n["at"]
    words = f"{n['largest_difference']:.4e}\n= {n['largest_difference_over_peak']:.2e} of the peak"
    seen = 3.0e6 * n["difference_at_nine_tenths"]
    difference.annotate(
        f"at the edge, beyond the frame:\n{words}", (place, 1.15 * seen), xytext=(-24, -4), textcoords="offset points",
        fontsize=9, ha="right", va="top", arrowprops={"arrowstyle": "->", "lw": 0.8},
    )  # fmt: skip
    nine = 0.9 * max(n["inner_edge"], n["outer_edge"])
    middle = 1e6 * n["difference_at_nine_tenths"]
    feature(difference, nine, middle, f"{n['difference_at_nine_tenths']:.3e} at 0.9 $a$", (-30, 14))
    for sign, where in ((1, "inner edge\nof the left ball"), (-1, "outer edge\nof the left ball")):
        difference.annotate(where, (sign * 0.82 * n["contact_radius"], -0.3 * seen * sign), ha="center", fontsize=9)
    difference.set(xlabel="$x / R$ from the ball's own axis", ylabel="$10^6\\,(p_{left} - p_{right}) / E_1$")
    difference.set(title="(b) left less right", ylim=(-1.2 * seen, 1.2 * seen))
    return figure


PART = Part("figure_9_pressure", "Figure 9: contact pressures and their difference", compute, draw)
