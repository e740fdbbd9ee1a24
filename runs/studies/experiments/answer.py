"""The study's page: all runs with both models, and the resulting text, tables and figures."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from runs.display.numbers import number
from runs.display.style import BLUE, GREEN, GREY, ORANGE, PURPLE, look, panels, save_figure
from runs.evolution.drawing import draw_top_views
from runs.evolution.hard_balls import HardBalls
from runs.process.files import write_csv
from runs.session.progress import print_status
from runs.studies import Options
from runs.studies.experiments import cases, resistance, side_by_side
from runs.studies.experiments.cases import CASES, distances
from runs.studies.experiments.points import NO, OPEN, POINTS, SIXES, Documents, Finding, Point
from runs.studies.experiments.side_by_side import Comparison
from runs.studies.framework.study import Study, command, timed
from runs.studies.framework.template import render

MODELS = {"linear_bem": "small strain", "finite_strain": "finite strain"}
STYLES = {"linear_bem": "-", "finite_strain": "--"}
OF_MEMBERS = (
    "seed", "at_rest", "cycles_end", "cycles_one_group", "contacts", "groups", "first_pairs", "neighbours_kept",
    "neighbours", "narrow_over_wide",
)  # fmt: skip
"""Columns of the table of ensemble members."""


class Judged(NamedTuple):
    """An observation and the finding of each model; None where runs are missing."""

    point: Point
    small: Finding | None
    large: Finding | None


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
    judged = [Judged(point, *(findings(point, found[model]) for model in MODELS)) for point in POINTS]
    by_command: dict[str, list[str]] = {}
    for name, one in missing.items():
        by_command.setdefault(one, []).append(name)
    return render(
        __file__,
        verdicts=[one.small.verdict for one in judged if one.small is not None],
        both=sum(one.small is not None and one.large is not None for one in judged),
        turned=[j.point.title for j in judged if j.small and j.large and j.small.verdict != j.large.verdict],
        observations=[_observation(one) for one in judged], errors=_errors(found), missing=by_command, command=by,
        pairs=[side_by_side.sentence(pair) for pair in pairs], forces=side_by_side.forces(pairs),
        runs=side_by_side.outcomes(found["linear_bem"], found["finite_strain"]),
        seconds=sum(document["solved"]["seconds"] for model in MODELS for document in found[model].values()),
        resistance=resistance.section(found["linear_bem"], by_share),
    )  # fmt: skip


def _observation(judged: Judged) -> dict[str, str]:
    """Return the row of one observation."""
    point, small, large = judged
    numbers = [small.numbers if small else ""]
    if large is not None:
        numbers.append(f"finite strain: {large.numbers}")
    verdicts = {f.verdict for f in (small, large) if f is not None}
    if point.reason and (verdicts & {NO, OPEN} or "fitted" in point.reason):
        numbers.append(point.reason)
    cells = (f.verdict if f is not None else "no table yet" for f in (small, large))
    words = (point.title, *cells, ". ".join(n for n in numbers if n))
    return dict(zip(("the paper reports", *MODELS.values(), "numbers and reasons"), words, strict=True))


def _errors(found: Mapping[str, Documents]) -> list[str]:
    """Return one sentence per source of error."""
    lines = []
    for model, name in MODELS.items():
        known = [table for document in found[model].values() if (table := document["pair_table"]) is not None]
        for radius, rows in {table["identity"]["radius"]: table["additivity"] for table in known}.items():
            text = "; ".join(
                f"{row['arrangement']} {100 * row['coupled']:.2g} % (bare sum of pairs {100 * row['bare_sum']:.2g} %; "
                f"own error of the full model {100 * row['tangential_force_error'] / row['tangential_force']:.1g} %)"
                for row in rows
            )
            lines.append(f"{name}, R = {1e3 * radius:g} mm: {text}")
        shares = [
            (row["share"], case, row["at"])
            for case, document in found[model].items()
            for row in document["direct_check"] or []
            if row["share"] is not None
        ]
        if shares:
            share, case, where = max(shares)
            lines.append(f"{name}: at starts and ends of the runs at most {100 * share:.2g} % ({case}, {where})")
        worst = max(
            ((d["position_error"], case) for case, d in found[model].items() if d["path"][-1]["sigma"] > 0.0),
            default=None,
        )
        if worst:
            lines.append(f"{name}: error of positions from time steps at most {1e3 * worst[0]:.2g} mm ({worst[1]})")
        for case, document in found[model].items():
            balance = document["equilibrium"]
            if document["rest"]["at_rest"] and balance is not None and balance["verdict"] != "stable":
                lines.append(f"{name}, {case}: the path ends near an equilibrium that is {balance['verdict']}")
    stable = [
        d["equilibrium"]["distance_from_end"]
        for model in MODELS
        for d in found[model].values()
        if d["rest"]["at_rest"] and d["equilibrium"] and d["equilibrium"]["verdict"] == "stable"
    ]
    lines += _speeds(found["linear_bem"])
    if stable:
        lines.append(
            f"{len(stable)} paths that came to rest end at most {1e3 * max(stable):.1e} mm from a stable equilibrium "
            "found by Newton's method"
        )
    return lines


def _speeds(documents: Documents) -> list[str]:
    """Return the steps per minute of processor time for nine balls, by the pair table and by the full model."""
    texts = []
    for name, words in (("nine, 30 mm", "by the pair table"), ("nine, 30 mm, full model", "by the full model")):
        if name in documents:
            solved, members = documents[name]["solved"], len(documents[name]["ensemble"])
            texts.append(
                f"{words} {solved['iterations']} steps of {members} member(s) in {number(solved['seconds'], 3)} s of "
                "processor time with all final checks, "
                f"{round(60.0 * solved['iterations'] / solved['seconds'], -2):.0f} a minute"
            )
    return [f"nine balls, small strain: {'; '.join(texts)}"] if texts else []


def _members(found: Mapping[str, Documents]) -> list[dict[str, Any]]:
    """Return one row per ensemble member of every run."""
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
        problem = case.read(quick=True).problem
        radii = [ball.radius for ball in problem.balls]
        draw_top_views(folder, document, HardBalls.of(problem), radii, (1.0, 0.0), "gathering")


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
