"""The text of a study's page, from a Jinja template next to the study's code."""

import re
from typing import Any

from runs.display.numbers import number
from runs.display.templates import environment
from runs.studies.framework.tables import markdown


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
