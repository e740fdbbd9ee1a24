"""The report on a study: its Markdown answer with figures, and the table of its cases."""

import itertools
import re
from pathlib import Path
from typing import Any

from runs.display.numbers import duration
from runs.reporting.folder import Folder
from runs.reporting.markup import box
from runs.reporting.pictures import figure

TITLE = re.compile(r"^# [# ]*(.*)$", re.MULTILINE)
"""The first heading of a Markdown text."""


def answer(folder: Folder) -> tuple[str, str, list[Path]]:
    """Return the first heading of the study's Markdown text, the rest as HTML, and the pictures that it shows."""
    from markdown_it import MarkdownIt  # noqa: PLC0415  (comes with rich; only a study's page needs it)

    text, shown = folder.words(), list[Path]()

    def image(self: Any, tokens: Any, index: int, options: Any, env: Any) -> str:
        token = tokens[index]
        source = folder.path / str(token.attrs["src"])
        vector = source.with_suffix(".svg")
        chosen = vector if vector.exists() else source
        if not chosen.exists():
            return ""
        shown.append(chosen)
        return figure(chosen, len(shown), token.content)

    reader = MarkdownIt("commonmark", {"html": False}).enable("table")
    reader.add_render_rule("image", image)
    html = reader.render(TITLE.sub("", text, count=1))
    html = html.replace("<p><figure>", "<figure>").replace("</figure></p>", "</figure>")
    count = itertools.count(1)
    html = re.sub(r"<table>.*?</table>", lambda t: box(t[0], f"table {next(count)}"), html, flags=re.DOTALL)
    title = TITLE.search(text)
    return title[1].strip() if title else "", html, shown


def cases(folder: Folder) -> list[dict[str, Any]]:
    """Return a row for each of a study's cases: state, load steps, processor time, reason."""
    return [
        {
            "case": record["name"],
            "model": record["model"],
            "state": record["state"],
            "load steps": len(record["steps"]),
            "ranks": record["ranks"],
            "processor time": duration(record["cpu_seconds"]),
            "reason": record.get("reason") or "",
        }
        for record in folder.cases()
    ]
