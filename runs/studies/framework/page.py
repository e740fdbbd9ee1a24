"""The text of a study's page: tables in Markdown, and a Jinja template next to the study's code."""

import math
import re
from collections.abc import Mapping, Sequence
from typing import Any

from runs.display.numbers import number, with_error
from runs.display.templates import environment


def render(module: str, name: str = "page.md.jinja", /, **values: Any) -> str:
    """Return the Markdown of the template ``name`` beside a module, which gives its ``__file__``.

    Templates format numbers by ``{{ value | as(".3g") }}`` or ``{{ value | number(3) }}``, lists of them by
    ``{{ values | each(".3g") }}``, and make tables by ``{{ table(rows) }}``. A line that begins with two spaces
    continues the line before.
    """
    jinja = environment(module, "a study's page")
    jinja.filters |= {"as": format, "number": number}
    jinja.filters["each"] = lambda values, spec, between=", ": between.join(format(v, spec) for v in values)
    jinja.globals["table"] = lambda *rows, **options: "\n".join(markdown(*rows, **options))
    return re.sub(r"\n {2}", " ", jinja.get_template(name).render(values)).rstrip("\n")


def markdown(
    rows: Sequence[Mapping[str, Any]],
    columns: Mapping[str, str] | Sequence[str] | None = None,
    *,
    digits: int = 4,
    aligned: bool = True,
) -> list[str]:
    """Return the lines of a table; ``columns`` maps keys to headings, or lists keys that are headings.

    By default the columns are the keys of the first row. A pair (value, error) is rounded to its error. ``aligned``
    right-aligns numbers.
    """
    if not rows:
        return ["(no rows yet)"]
    columns = columns or {key: key.replace("_", " ") if key.islower() else key for key in rows[0]}
    columns = columns if isinstance(columns, Mapping) else dict(zip(columns, columns, strict=True))
    words = {key for row in rows for key, value in row.items() if isinstance(value, str)}
    sides = [("---" if not aligned else ":--" if key in words else "--:") for key in columns]
    lines = [f"| {' | '.join(columns.values())} |", f"|{'|'.join(sides)}|"]
    return lines + [f"| {' | '.join(written(row.get(key), digits) for key in columns)} |" for row in rows]


def written(value: Any, digits: int = 4) -> str:
    """Return one cell: a number to ``digits``, a dash for None or nan, value and error for a pair."""
    if isinstance(value, tuple):
        return with_error(*value)
    if value is None or (isinstance(value, float) and math.isnan(value)):
        return "-"
    if isinstance(value, float):
        return number(value, digits)
    return str(value).replace("|", "\\|").replace("\n", " ")
