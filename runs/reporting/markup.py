"""Pieces of an HTML page: text is escaped, tables scroll in their own box, every picture has a text beside it."""

from collections.abc import Mapping, Sequence
from html import escape
from typing import Any

from runs.display.numbers import number, with_error

LONG = 60
"""Characters from which a cell's text may wrap."""


def tag(name: str, content: str, **attributes: str) -> str:
    """Return an element around finished HTML; ``class_`` stands for class."""
    said = "".join(f' {key.rstrip("_").replace("_", "-")}="{escape(value)}"' for key, value in attributes.items())
    return f"<{name}{said}>{content}</{name}>"


def paragraph(text: str, **attributes: str) -> str:
    """Return a paragraph of plain text."""
    return tag("p", escape(text), **attributes)


def facts(items: Mapping[str, str]) -> str:
    """Return names and values as a list of small cards."""
    cells = "".join(f"<div><dt>{escape(name)}</dt><dd>{escape(value)}</dd></div>" for name, value in items.items())
    return tag("dl", cells, class_="facts")


def table(rows: Sequence[Mapping[str, Any]], caption: str) -> str:
    """Return rows as a table in a box that scrolls, under the names of their keys; a pair is a value with its error."""
    columns = {key: heading(key) for row in rows for key in row}
    wordy = {key for key in columns if any(_is_words(row.get(key)) for row in rows)}
    head = "".join(
        tag("th", escape(title), scope="col", **({"class_": "words"} if key in wordy else {}))
        for key, title in columns.items()
    )
    body = "".join(tag("tr", "".join(_cell(row.get(key)) for key in columns)) for row in rows)
    content = tag("caption", tag("span", escape(caption))) + tag("thead", tag("tr", head)) + tag("tbody", body)
    return box(tag("table", content), caption)


def _cell(value: Any) -> str:
    if isinstance(value, tuple):
        value = with_error(*value)
    if isinstance(value, str):
        return _words(value) if _is_words(value) else tag("td", escape(value))
    if isinstance(value, float):
        return tag("td", escape(number(value)))
    return tag("td", "\u2013" if value is None else escape(str(value)))


def heading(key: str) -> str:
    """Return a key as a heading: words of a plain key apart, a symbol such as S_Q as it is."""
    return key.replace("_", " ") if key.islower() else key


def _is_words(value: Any) -> bool:
    return isinstance(value, str) and not (value[:1] in "-(0123456789" and len(value) < LONG // 2)


def _words(value: str) -> str:
    return tag("td", escape(value), class_="long" if len(value) > LONG else "words")


def box(content: str, label: str) -> str:
    """Return finished HTML in a box that scrolls sideways and can be reached by the keyboard."""
    return tag("div", content, class_="scroll", role="region", tabindex="0", aria_label=label)


def code(text: str) -> str:
    """Return text as it is, in its own box."""
    return tag("pre", tag("code", escape(text)), tabindex="0")


def folded(title: str, content: str) -> str:
    """Return finished HTML that opens on demand."""
    return tag("details", tag("summary", escape(title)) + content)


def section(title: str, *content: str) -> str:
    """Return a section with its heading; nothing where there is no content."""
    inside = "".join(content)
    return tag("section", tag("h2", escape(title)) + inside) if inside else ""
