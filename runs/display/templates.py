"""Loads the Jinja templates that lie beside the modules that use them."""

from pathlib import Path
from typing import Any

from linear_bem.errors import MissingDependency


def environment(module: str, use: str, **options: Any) -> Any:
    """Return the Jinja environment of the templates beside a module, which gives its ``__file__``.

    A value that is not given is an error. Raises `MissingDependency` with the ``use`` that needs Jinja.
    """
    try:
        from jinja2 import Environment, FileSystemLoader, StrictUndefined  # noqa: PLC0415  (may be absent)
    except ImportError as error:
        raise MissingDependency(f"{use} needs jinja2: {error}; install it by `pip install jinja2`") from None
    loader = FileSystemLoader(Path(module).parent)
    return Environment(loader=loader, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True, **options)
