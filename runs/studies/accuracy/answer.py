"""Errors and costs of all cases, the Pareto front, and the cheapest settings for a given error."""

import math
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from runs.display.numbers import duration
from runs.process.files import write_csv
from runs.studies.accuracy.matrix import ALL_RANKS, LADDER, OWN, PARAMETERS, REFERENCES, TRUE, USUAL_CASE, cases
from runs.studies.accuracy.picture import draw
from runs.studies.framework.case import SMALL
from runs.studies.framework.page import render
from runs.studies.framework.runner import study_of_cases
from runs.studies.framework.saved_cases import DONE, Found

WANTED = (0.1, 0.01, 0.001)
SAME_TIME = 1.25
"""Processor times with a smaller ratio than this are equal within the noise of a shared machine."""
DEFAULTS = ("linear-bem-0.0001", "small-strain-0.02", "finite-strain-0.02")
"""Cases with the default accuracies, those of a scene without [accuracy]; the last one is also solved on all ranks."""


def present(found: Found, folder: Path) -> str:
    """Write accuracy.csv and pareto.svg; return tables and advice as Markdown."""
    rows = measured(found)
    if rows:
        write_csv(folder / "accuracy.csv", rows)
        draw(rows, folder)
    by_case = {row["case"]: row for row in rows}
    usual, one = by_case.get(USUAL_CASE), by_case.get(DEFAULTS[-1])
    ranks = next((row for row in rows if row["parameter"] == ALL_RANKS), None)
    judged = _judged(rows)
    return render(
        __file__, rows=rows, own=OWN, against=TRUE,
        approach=found.cases[0].problem.load.values[0],
        references=[r for model in ("finite_strain", "linear_bem") if (r := _reference(found, model)) is not None],
        cheapest=[("T at finite strain", list(advice(rows, TRUE))), ("T of a given model", list(advice(rows, OWN)))],
        asked=_asked(rows),
        usual=usual, usual_error=usual and usual[OWN], changed=_changed(rows, usual) if usual else [], all_ranks=ranks,
        one_rank=one, change_by_ranks=_relative(ranks["force"], one["force"]) if ranks and one else None,
        judged=judged, beyond=sum(share > 1.0 for share, _ in judged),
    )  # fmt: skip


def measured(found: Found) -> list[dict[str, Any]]:
    """Return one row per finished case with its errors; errors against a missing reference are None."""
    truth = _force(found, REFERENCES["finite_strain"])
    known = {model: (_reference(found, model) or {}).get("relative error") for model in REFERENCES}
    rows = []
    for case in found.cases:
        if found.state(case.name) != DONE:
            continue
        record, force = found.records[case.name], _force(found, case.name)
        own = _force(found, REFERENCES[case.model])
        ball = found.steps(case.name)[-1]["balls"][0]
        whole = own or force  # the errors, too, are over the reference's T
        rows.append(
            {
                "case": case.name,
                "model": case.model,
                "force": force,
                **case.labels,
                OWN: None if case.name == REFERENCES[case.model] else _relative(force, own),
                TRUE: None if case.name == REFERENCES["finite_strain"] else _relative(force, truth),
                f"{OWN}, known to": known[case.model],
                f"{TRUE}, known to": known["finite_strain"],
                "estimate": ball["tangential_force_error"] / abs(whole) if whole else None,
                "steps": len(found.steps(case.name)) if case.parallel else None,
                "iterations": record["solved"]["iterations"],
                "unknowns": record["solved"]["unknowns"],
                "ranks": record["ranks"],
                "seconds": record["cpu_seconds"],
                "wall": record["wall_seconds"],
            }
        )
    return rows


def _asked(rows: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """Return the rows of the requested accuracies, with the defaults marked."""
    return [
        {**row, "asked of": f"{row['model']}, {row['value']:g}{' (default)' if row['case'] in DEFAULTS else ''}"}
        for row in rows
        if row["parameter"] == "accuracy asked"
    ]


def _changed(rows: Sequence[Mapping[str, Any]], usual: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Return the effect of each numerical parameter on T on one mesh, and its cost."""
    return [
        {
            "parameter": row["parameter"],
            "value": row["value"],
            "change of T": _relative(row["force"], usual["force"]),
            "iterations": row["iterations"],
            "time / default": row["seconds"] / usual["seconds"],
        }
        for row in rows
        if row["parameter"] in PARAMETERS
    ]


def _judged(rows: Sequence[Mapping[str, Any]]) -> list[tuple[float, str]]:
    """Return errors over their own estimates, with the model, where the reference is accurate enough.

    Small strain is left out: its estimate is its difference from the reference.
    """
    return [
        (row[OWN] / row["estimate"], row["model"])
        for row in rows
        if row[OWN] is not None
        and row["model"] != SMALL
        and row["estimate"]
        and (row[f"{OWN}, known to"] or math.inf) < 0.1 * row["estimate"]
    ]


def _force(found: Found, name: str) -> float | None:
    if found.state(name) != DONE:
        return None
    return float(found.steps(name)[-1]["balls"][0]["tangential_force"][0])


def _relative(force: float | None, reference: float | None) -> float | None:
    return None if force is None or not reference else abs(force / reference - 1.0)


def _reference(found: Found, model: str) -> dict[str, Any] | None:
    force = _force(found, REFERENCES[model])
    if force is None:
        return None
    error = found.steps(REFERENCES[model])[-1]["balls"][0]["tangential_force_error"]
    return {"model": model, "T / E1 R²": (force, error), "relative error": error / abs(force) if force else None}


def advice(rows: Sequence[Mapping[str, Any]], column: str) -> Iterator[dict[str, Any]]:
    """Yield the cheapest user settings for every wanted error.

    A case counts if its error, its own estimate and the reference's error are all below the wanted error: an error that
    is small by chance, or not resolved by the reference, does not count.
    """
    usual = [row for row in rows if row["parameter"] in LADDER and row[column] is not None]
    models = dict.fromkeys(row["model"] for row in usual) if column == OWN else [None]
    for model in models:
        for wanted in WANTED:
            enough = [r for r in usual if model in (None, r["model"]) and _relied_on(r, column) <= wanted]
            cheapest = min((row["seconds"] for row in enough), default=0.0)
            # of cases with the same cost within noise, the one with the loosest tolerance
            alike = [row for row in enough if row["seconds"] <= SAME_TIME * cheapest]
            best = max(alike, key=lambda row: row["value"] or math.inf, default=None)
            row = {**({"model": model} if model else {}), "for": f"{100 * wanted:g} %"}
            row |= {"use": "no case is known to reach it", "error reached": None, "processor time": "-"}
            if best is not None:
                use = f"{best['model']}, {best['parameter']} {best['value']}".rstrip(", ")
                row |= {"use": use, "error reached": best[column], "processor time": duration(best["seconds"])}
            yield row


def _relied_on(row: Mapping[str, Any], column: str) -> float:
    return max(row[column], row["estimate"] or math.inf, row[f"{column}, known to"] or math.inf)


STUDY = study_of_cases("accuracy", cases, present, ("pareto.svg", "pareto.png"))
