"""The text of a study's page: a Jinja template beside the study's code."""

import re
from pathlib import Path
from typing import Any

from linear_bem.errors import MissingDependency
from runs.studies.framework.tables import markdown


def render(module: str, name: str = "page.md.jinja", /, **values: Any) -> str:
    """Return the Markdown of the template ``name`` beside a module, which gives its ``__file__``.

    Templates format numbers by ``{{ value | as(".3g") }}``, lists of them by ``{{ values | each(".3g") }}``, and make
    tables by ``{{ table(rows) }}``. A line that begins with two spaces continues the line before.
    """
    try:
        from jinja2 import Environment, FileSystemLoader, StrictUndefined  # noqa: PLC0415  (may be absent)
    except ImportError as error:
        raise MissingDependency(f"a study's page needs jinja2: {error}; install it by `pip install jinja2`") from None
    loader = FileSystemLoader(Path(module).parent)
    environment = Environment(loader=loader, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True)
    environment.filters["as"] = format
    environment.filters["each"] = lambda values, spec, between=", ": between.join(format(v, spec) for v in values)
    environment.globals["table"] = lambda *rows, **options: "\n".join(markdown(*rows, **options))
    return re.sub(r"\n {2}", " ", environment.get_template(name).render(values)).rstrip("\n")
