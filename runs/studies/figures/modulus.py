"""Figure 11: T over the layer's modulus at constant force and constant substrate."""

from typing import Any

import numpy as np

from runs.display.style import BLUE, feature, panels, zero_line
from runs.studies.figures.pair import Curve, Pair, at_features, line_through, scene
from runs.studies.figures.part import Findings, Part

UNIT = 60e6
"""Modulus [Pa] by which the paper scales the force: E1 at E1/E2 = 1e-3, hence E2 = 60 GPa here."""
MAIN = 1.16
THICKNESSES = (0.6, MAIN, 1.5)


def compute(quick: bool) -> Findings:
    """Return T'' = T/(60 MPa R^2) over E1 from 6 MPa to 6e6 MPa, the sign change and the maximum."""
    asked = at_features(quick)
    substrate = scene().problem.substrate
    assert substrate is not None
    young, coarse = np.geomspace(0.1, 1e5, 11 if quick else 73), np.geomspace(1.0, 1e5, 26)
    curves = {
        h: Curve(lambda e, h=h: Pair(thickness=h, young=e), young if h == MAIN else coarse, asked)  # type: ignore[misc]
        for h in ((MAIN,) if quick else THICKNESSES)
    }
    rows = {}
    for thickness, curve in curves.items():
        top, value = curve.extremum(1.0)
        rows[thickness] = {"thickness": thickness, "change": curve.sign_changes()[0], "top": top, "value": value}
    main, force = rows[MAIN], curves[MAIN].values
    numbers = {
        "sign_change_over_E2": main["change"] / substrate.young,
        "sign_change_GPa": main["change"] * UNIT / 1e9,
        "maximum": main["value"],
        "maximum_over_E2": main["top"] / substrate.young,
        "maximum_GPa": main["top"] * UNIT / 1e9,
        "at_60_MPa": Pair().attraction(asked),
        "largest_over_at_60_MPa": abs(main["value"] / Pair().attraction(asked)),
        "E1_T_at_6_MPa": young[0] * force[0],
        "stiffest_over_maximum": force[-1] / main["value"],
        "other_thicknesses": [
            {k: v / substrate.young if k in ("change", "top") else v for k, v in row.items()} for row in rows.values()
        ],
    }
    table = {"E1_MPa": young * UNIT / 1e6, "E1_over_E2": young / substrate.young, "T": force}
    return Findings({"modulus": table}, numbers)


def draw(found: Findings) -> Any:
    """Draw T'' over E1: the range of separation, and enlarged that of attraction."""
    t, n = found.tables["modulus"], found.numbers
    gigapascals = np.array(t["E1_MPa"]) / 1e3
    young, force = line_through(gigapascals, t["T"], [n["sign_change_GPa"]], power=1.0)
    figure, (soft, stiff) = panels(5.0, 6.4)
    soft.plot(young, 1e7 * force, color=BLUE)
    zero_line(soft)
    feature(soft, 0.06, 1e7 * n["at_60_MPa"], f"$E_1$ = 60 MPa:\n{1e7 * n['at_60_MPa']:.6f}", (24, -14))
    soft.set(xscale="log", xlim=(0.01, 30.0), ylim=(-7.0, 0.5), xlabel="$E_1$ [GPa]")
    soft.set(ylabel="$10^7\\,T'' = 10^7\\,T / (60\\,\\mathrm{MPa}\\,R^2)$", title="(a) soft layers separate the balls")
    stiff.plot(young, 1e10 * force, color=BLUE)
    zero_line(stiff)
    change, top = n["sign_change_GPa"], n["maximum_GPa"]
    feature(stiff, change, 0.0, f"T = 0 at {change:.3f} GPa\n$E_1/E_2$ = {n['sign_change_over_E2']:.4f}", (-8, 26))
    words = f"maximum {1e10 * n['maximum']:.4f}\nat {top:.1f} GPa, $E_1/E_2$ = {n['maximum_over_E2']:.3f}"
    feature(stiff, top, 1e10 * n["maximum"], words, (14, 16))
    stiff.axvline(60.0, color="0.5", lw=0.8, ls="--", zorder=0)
    stiff.annotate("$E_1 = E_2$ ", (60.0, -2.6), fontsize=9, color="0.35", ha="right")
    stiff.set(xscale="log", xlim=(0.6, 6000.0), ylim=(-4.0, 5.8), xlabel="$E_1$ [GPa]", ylabel="$10^{10}\\,T''$")
    stiff.set_title("(b) stiff layers, enlarged: attraction, with a maximum")
    return figure


PART = Part("figure_11_modulus", "Figure 11: T over the layer's modulus", compute, draw)
