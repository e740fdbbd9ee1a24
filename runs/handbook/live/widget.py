"""The live page's fragment of HTML: style, sliders, table and script in one, so that the page needs no other file."""

import json
import re
from pathlib import Path
from typing import Any

from runs.comparison import strengthening_fit
from runs.handbook.live import table

HERE = Path(__file__).resolve().parent
STUDY = HERE.parents[1] / "studies" / "strengthening" / "README.md"
FACTOR = re.compile(r"(?P<factor>-?[\d.]+) ± (?P<error>[\d.]+)")


def html() -> str:
    """Return the fragment."""
    factors = strengthening(STUDY.read_text(encoding="utf-8"))
    data = {**table.read().data, "strengthening": factors, "fit": strengthening_fit.as_data()}
    parts = {name: (HERE / f"live.{name}").read_text(encoding="utf-8") for name in ("css", "html", "js")}
    return (
        f"<style>\n{parts['css']}</style>\n{parts['html']}"
        f'<script type="application/json" id="live-table">{json.dumps(data, separators=(",", ":"))}</script>\n'
        f"<script>\n{parts['js']}</script>\n"
    )


def with_errors(page: str) -> str:
    """Return the page's text with the errors inserted for {{ PART_NAME }} and {{ PART_NAME_median }}."""
    for part, errors in zip(("thin", "thick"), table.read().data["errors"], strict=True):
        for kind, values in (("", errors["largest"]), ("_median", errors["median"])):
            for name, value in values.items():
                page = page.replace(f"{{{{ {part}_{name}{kind} }}}}", f"{value:.1g}")
    return page


def strengthening(page: str) -> list[dict[str, Any]]:
    """Return the published cases, each with its points [D / R, S_Q, error], from the tables of the study's page."""
    cases: dict[tuple[float, float, float], dict[float, tuple[float, float]]] = {}
    for title, words in (("thin", r"thin layer: (.*)"), ("thick", r"thick layer: (.*)")):
        head = re.search(rf"^## Along the load, {words}$", page, re.MULTILINE)
        if head is None:
            raise ValueError(f"{STUDY}: no table along the load of the {title} layer")
        thickness, distance, poisson = map(float, re.findall(r"= ([\d.]+)", head[1]))
        points = cases.setdefault((thickness, distance, poisson), {})
        for cells in _rows(page, head.end())[1:]:
            points[float(cells[0])] = _factor(cells[4])
    start = page.index("## Distance, thickness, Poisson's ratio")
    header, *rows = _rows(page, start)
    depths = [float(re.findall(r"[\d.]+", cell)[0]) for cell in header[3:]]
    for cells in rows:
        thickness, distance, poisson = map(float, cells[:3])
        points = cases.setdefault((thickness, distance, poisson), {})
        for depth, cell in zip(depths, cells[3:], strict=True):
            if FACTOR.search(cell):
                points.setdefault(depth, _factor(cell))
    return [
        {"thickness": h, "distance": distance, "poisson": nu, "points": [[d, *points[d]] for d in sorted(points)]}
        for (h, distance, nu), points in cases.items()
    ]


def _rows(page: str, start: int) -> list[list[str]]:
    """Return the cells of the first table after ``start``, header first, without the separator line."""
    lines = page[page.index("\n|", start) + 1 :].split("\n\n", maxsplit=1)[0].splitlines()
    return [[cell.strip() for cell in line.strip("|").split("|")] for line in lines if not line.startswith("|-")]


def _factor(cell: str) -> tuple[float, float]:
    found = FACTOR.search(cell)
    if found is None:
        raise ValueError(f"{STUDY}: not a factor with its error: {cell}")
    return float(found["factor"]), float(found["error"])
