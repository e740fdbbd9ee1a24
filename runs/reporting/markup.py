"""The HTML of a report; its template escapes text, and wide tables scroll in a box of their own."""

from collections.abc import Mapping, Sequence
from html import escape
from typing import Any

from runs.display.numbers import number, with_error
from runs.display.templates import environment

LONG = 60
"""Number of characters from which a cell's text may wrap."""


def render(**values: Any) -> str:
    """Return the page of the template beside this module."""
    jinja = environment(__file__, "report", autoescape=True)
    jinja.filters |= {"columns": columns, "cell": cell}
    return jinja.get_template("page.html.jinja").render(values)


def columns(rows: Sequence[Mapping[str, Any]]) -> dict[str, tuple[str, bool]]:
    """Return the heading of every column, and whether it holds words; a symbol such as S_Q keeps its underscore."""
    keys = dict.fromkeys(key for row in rows for key in row)
    return {
        key: (key.replace("_", " ") if key.islower() else key, any(_is_words(row.get(key)) for row in rows))
        for key in keys
    }


def cell(value: Any) -> tuple[str, str]:
    """Return text and class of a cell; a pair is a value with its error."""
    if isinstance(value, tuple):
        value = with_error(*value)
    if isinstance(value, str):
        return value, ("long" if len(value) > LONG else "words") if _is_words(value) else ""
    return ("\u2013" if value is None else number(value) if isinstance(value, float) else str(value)), ""


def _is_words(value: Any) -> bool:
    return isinstance(value, str) and not (value[:1] in "-(0123456789" and len(value) < LONG // 2)


def box(content: str, label: str) -> str:
    """Return HTML in a box that scrolls sideways and can be reached by the keyboard."""
    return f'<div class="scroll" role="region" tabindex="0" aria-label="{escape(label)}">{content}</div>'
