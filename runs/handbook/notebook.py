"""A tutorial as a Jupyter notebook: the page's text, its blocks as cells with the output from the build of the page.

The format is plain JSON (nbformat 4.5, https://nbformat.readthedocs.io) and is written here without nbformat, which
depends on compiled packages.
"""

import json
import re
from typing import Any

FENCED = re.compile(
    r"^```(?P<language>toml|sh|python)\n(?P<code>.*?)^```$(?P<printed>(?:\n+^```(?:text|none)\n.*?^```$)*)", re.S | re.M
)
FENCE = re.compile(r"^```.*\n?", re.M)
LINK = re.compile(r"(?<!!)\[([^\]]*)\]\((?!https?:)[^)]*\)")
PICTURE = re.compile(r'!\[([^\]]*)\]\(\S+ "([^"]*)"\)')
ROLE = re.compile(r"\{[a-z:]+\}(`[^`]*`)")


def notebook(page: str) -> str:
    """Return the notebook of a tutorial whose blocks were run; links within the handbook become plain text."""
    cells, end = [], 0
    for block in FENCED.finditer(page):
        cells.append(_cell("markdown", page[end : block.start()]))
        cells.append(_code(block))
        end = block.end()
    cells.append(_cell("markdown", page[end:]))
    there = [{**cell, "id": f"cell-{number}"} for number, cell in enumerate(cells) if cell["source"]]
    kernel = {"display_name": "Python 3", "language": "python", "name": "python3"}
    return json.dumps(
        {"cells": there, "metadata": {"kernelspec": kernel}, "nbformat": 4, "nbformat_minor": 5}, indent=1
    )


def _cell(kind: str, text: str) -> dict[str, Any]:
    own = PICTURE.sub(r"![\1](\2)", text)  # as the cells before write it
    plain = ROLE.sub(r"\1", LINK.sub(r"\1", own)).strip() if kind == "markdown" else text.rstrip()
    return {"cell_type": kind, "metadata": {}, "source": plain.splitlines(keepends=True)}


def _code(block: re.Match[str]) -> dict[str, Any]:
    language, code = block["language"], block["code"]
    named = re.match(r"# (\S+\.toml)\n", code)
    if language == "toml" and not named:
        return _cell("markdown", block[0])
    magic = {"toml": f"%%writefile {named[1]}\n" if named else "", "sh": "%%bash\n", "python": ""}[language]
    printed = FENCE.sub("", block["printed"]).lstrip("\n").splitlines(keepends=True)
    outputs = [{"output_type": "stream", "name": "stdout", "text": printed}] if printed else []
    return {**_cell("code", magic + code), "execution_count": None, "outputs": outputs}
