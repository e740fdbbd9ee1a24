"""The study's page: all runs with both models, and the resulting text, tables and figures."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from runs.display.style import BLUE, GREEN, GREY, ORANGE, PURPLE, look, panels, save_figure
from runs.evolution.drawing import draw_top_views
from runs.evolution.hard_balls import HardBalls
from runs.process.files import write_csv
from runs.scene.units import Unit
from runs.session.progress import print_status
from runs.studies import Options
from runs.studies.experiments import cases, resistance, side_by_side
from runs.studies.experiments.cases import CASES, distances
from runs.studies.experiments.points import NO, OPEN, POINTS, SIXES, Documents, Finding, Point
from runs.studies.experiments.side_by_side import Comparison
from runs.studies.framework.page import render
from runs.studies.framework.study import Study, command, timed

MODELS = {"linear_bem": "small strain", "finite_strain": "finite strain"}
STYLES = {"linear_bem": "-", "finite_strain": "--"}
OF_MEMBERS = (
    "seed", "at_rest", "cycles_end", "cycles_one_group", "contacts", "groups", "first_pairs", "neighbours_kept",
    "neighbours", "narrow_over_wide",
)  # fmt: skip
"""Columns of the table of ensemble members."""
TIMED = {"nine, 30 mm": "by the pair table", "nine, 30 mm, full model": "by the full model"}
"""Runs of equal balls whose speeds are compared."""


def compute(folder: Path, options: Options) -> None:
    """Evolve every case at small strain, and at finite strain where its pair table is complete."""
    for case in cases.chosen(options.quick):
        for model, scene in cases.runs_of(case, options.quick):
            with timed(f"{case.name}, {model}"):
                cases.evolve(case, scene, model, folder, fresh=options.fresh, pictures=not options.quick)
    if not options.quick:
        resistance.compute(folder, fresh=options.fresh)


def page(folder: Path, quick: bool) -> str:
    """Write table and figures; return the answer as Markdown."""
    found: dict[str, dict[str, Any]] = {model: {} for model in MODELS}
    missing: dict[str, str] = {}
    for case in cases.chosen(quick):
        runs = cases.runs_of(case, quick)
        if case.finite is not None and len(runs) < 2:
            missing[case.name] = f"mpirun -n 2 thirdbody evolve runs/scenes/experiment_{case.finite}.toml"
        for model, scene in runs:
            document = cases.evolve(case, scene, model, folder, compute=False)
            if document is None:
                print_status(f"{case.name}, {model}: no saved run")
            else:
                found[model][case.name] = document
    write_csv(folder / "experiments.csv", _members(found))
    draw(folder, found)
    draw_gathering(folder, found)
    by_share = {} if quick else resistance.found(folder)
    return answer(found, missing, side_by_side.comparisons(), command("experiments", quick), by_share)


def findings(point: Point, documents: Documents) -> Finding | None:
    """Return the finding of one model's runs, or None where runs are missing."""
    return point.judge(documents) if all(name in documents for name in point.cases) else None


def answer(
    found: Mapping[str, Documents], missing: Mapping[str, str], pairs: Sequence[Comparison], by: str,
    by_share: Mapping[float, Documents],
) -> str:  # fmt: skip
    """Return the answer in Markdown; ``missing`` gives the command for each missing finite-strain table.

    ``pairs`` compares the forces on two balls in both models, ``by_share`` holds the runs with rolling resistance.
    """
    small, large = (found[model] for model in MODELS)
    judged = [(point, findings(point, small), findings(point, large)) for point in POINTS]
    by_command: dict[str, list[str]] = {}
    for name, one in missing.items():
        by_command.setdefault(one, []).append(name)
    return render(
        __file__,
        verdicts=[first.verdict for _, first, _ in judged if first],
        both=sum(first is not None and second is not None for _, first, second in judged),
        turned=[point.title for point, first, second in judged if first and second and first.verdict != second.verdict],
        observations=[_observation(*one) for one in judged], missing=by_command, command=by,
        errors=[_errors(words, found[model]) for model, words in MODELS.items()],
        speeds=[(words, small[name]) for name, words in TIMED.items() if name in small],
        pairs=[side_by_side.sentence(pair) for pair in pairs], forces=side_by_side.forces(pairs),
        runs=side_by_side.outcomes(small, large),
        seconds=sum(document["solved"]["seconds"] for model in MODELS for document in found[model].values()),
        resistance=resistance.section(small, by_share),
    )  # fmt: skip


def _observation(point: Point, small: Finding | None, large: Finding | None) -> dict[str, str]:
    """Return the row of one observation, with the findings of both models (None where runs are missing)."""
    numbers = [small.numbers if small else ""]
    if large is not None:
        numbers.append(f"finite strain: {large.numbers}")
    verdicts = {f.verdict for f in (small, large) if f is not None}
    if point.reason and (verdicts & {NO, OPEN} or "fitted" in point.reason):
        numbers.append(point.reason)
    cells = (f.verdict if f is not None else "no table yet" for f in (small, large))
    words = (point.title, *cells, ". ".join(n for n in numbers if n))
    return dict(zip(("the paper reports", *MODELS.values(), "numbers and reasons"), words, strict=True))


def _errors(model: str, documents: Documents) -> dict[str, Any]:
    """Return one model's sources of error: additivity by radius and nu, and largest errors with their case."""
    tables = [table for document in documents.values() if (table := document["pair_table"]) is not None]
    solids = [(table["identity"]["radius"], table["identity"]["layer"]["poisson"]) for table in tables]
    shares = [
        (row["share"], case, row["at"])
        for case, document in documents.items()
        for row in document["direct_check"] or []
        if row["share"] is not None
    ]
    places = [(d["position_error"], case) for case, d in documents.items() if d["path"][-1]["sigma"] > 0.0]
    ends = {case: d["equilibrium"] for case, d in documents.items() if d["rest"]["at_rest"] and d["equilibrium"]}
    return {
        "model": model,
        "additivity": {solid: table["additivity"] for solid, table in zip(solids, tables, strict=True)},
        "share": max(shares, default=None), "place": max(places, default=None),
        "unstable": {case: end["verdict"] for case, end in ends.items() if end["verdict"] != "stable"},
        "stable": [end["distance_from_end"] for end in ends.values() if end["verdict"] == "stable"],
    }  # fmt: skip


def _members(found: Mapping[str, Documents]) -> list[dict[str, Any]]:
    return [
        {
            "model": model,
            "case": case,
            **{key: member[key] for key in OF_MEMBERS},
            "groups": " ".join(map(str, member["groups"])),
            "first_pairs": " ".join(f"{i}-{j}" for i, j in member["first_pairs"]),
        }
        for model in MODELS
        for case, document in found[model].items()
        for member in document["ensemble"]
    ]


@look()
def draw(folder: Path, found: Mapping[str, Documents]) -> None:
    """Write experiments.png and .svg: distances over cycles of a line of four and of the three pairs."""
    figure, (four, pair) = panels(5.0, 5.0, height=3.9)
    for model in MODELS:
        document = found[model].get("line of four, 30 mm")
        if document is not None:
            for (i, j), color in zip(((0, 1), (1, 2), (2, 3)), (BLUE, ORANGE, GREEN), strict=True):
                cycle, distance = distances(document, i, j)
                label = f"balls {i} - {j}" if model == "linear_bem" else None
                four.plot(cycle, 1e3 * distance, STYLES[model], color=color, label=label)
        _draw_pairs(pair, found[model], model)
    four.set(xlabel="cycles", ylabel="distance of the axes [mm]", xlim=(0.0, 300.0))
    four.set_title("Line of four balls, 30 mm apart, on foam")
    four.legend()
    pair.axhline(50.0, color=GREY, lw=0.8, ls=":")
    pair.annotate(
        "16 mm balls in the experiment", (1.0, 50.0), xycoords=("axes fraction", "data"), xytext=(-2, 4),
        textcoords="offset points", ha="right", fontsize=8, color=GREY,
    )  # fmt: skip
    pair.set(xlabel="cycles", ylabel="distance of the axes [mm]", xlim=(0.0, 200.0), ylim=(0.0, 75.0))
    pair.set_title("Pairs on thin rubber" + (" (dashed: finite strain)" if found["finite_strain"] else ""))
    pair.legend(loc="center right", bbox_to_anchor=(1.0, 0.45))
    save_figure(figure, folder, "experiments")


def draw_gathering(folder: Path, found: Mapping[str, Documents]) -> None:
    """Write gathering.png and .svg: a line of six balls from above, by small strain, as in the source's figure 3."""
    case = next(case for case in CASES if case.name == SIXES[0])
    document = found["linear_bem"].get(case.name)
    if document is not None:
        balls = HardBalls.of(case.read(quick=True).problem)
        draw_top_views(folder, document, balls, (1.0, 0.0), Unit("mm", 1e-3), "gathering")


def _draw_pairs(axis: Any, documents: Documents, model: str) -> None:
    for size, color in ((16, BLUE), (10, ORANGE), (7, PURPLE)):
        document = documents.get(f"pair, {size} mm balls")
        if document is None:
            continue
        cycle, distance = distances(document, 0, 1)
        if document["rest"]["at_rest"]:
            cycle, distance = np.append(cycle, 200.0), np.append(distance, distance[-1])
        label = f"{size} mm balls" if model == "linear_bem" else None
        axis.plot(cycle, 1e3 * distance, STYLES[model], color=color, label=label)


STUDY = Study("experiments", compute, page, ("experiments.svg", "gathering.svg"), saves="*-linear_bem")
