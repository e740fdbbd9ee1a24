"""The page that lists every command with its arguments and options, generated from `runs.cli`."""

from typing import Any

import typer

from runs.cli import app
from runs.studies.framework.page import markdown

HEAD = """# The command line

`thirdbody COMMAND --help` prints the same. This page is generated from the code of the command line.
"""


def page() -> str:
    """Return the page in Markdown."""
    group: Any = typer.main.get_command(app)
    return "\n".join([HEAD, *(_section(name, command) for name, command in group.commands.items())])


def _section(name: str, command: Any) -> str:
    named = ((_name(p), p.param_type_name == "argument") for p in command.params)
    usage = " ".join(name if argument else f"[{name}]" for name, argument in named)
    rows = [{"option": f"`{_name(p)}`", "meaning": p.help or ""} for p in command.params if p.name != "help"]
    table = "\n".join(markdown(rows, aligned=False)) + "\n" if rows else ""
    return f"## `{name}`\n\n{command.help}\n\n```text\nthirdbody {name} {usage}\n```\n\n{table}"


def _name(parameter: Any) -> str:
    if parameter.param_type_name == "argument":
        return str(parameter.metavar or parameter.human_readable_name)
    value = "" if parameter.is_flag else f" {parameter.metavar or parameter.name.upper()}"
    return f"{max(parameter.opts, key=len)}{''.join(f' / {no}' for no in parameter.secondary_opts)}{value}"
