"""Templates of the studies' pages: numbers, lists and tables as asked, continued lines, and no silent gaps."""

from __future__ import annotations

import tomllib
from pathlib import Path

import pytest
from jinja2 import UndefinedError

from runs.studies.framework.page import render
from tests.launch import ROOT


def page(folder: Path, template: str, **values: object) -> str:
    (folder / "page.md.jinja").write_text(template, encoding="utf-8")
    return render(str(folder / "answer.py"), **values)


def test_numbers_lists_and_tables_are_written_as_the_template_says(tmp_path: Path) -> None:
    text = page(
        tmp_path,
        'x = {{ x | as(".2e") }}, at\n  {{ places | each(".1f", " and ") }}.\n\n{{ table(rows, aligned=False) }}\n\n',
        x=-1.5, places=[1.0, 2.25], rows=[{"a": 1.0, "b": (2.0, 0.1)}],
    )  # fmt: skip
    assert text == "x = -1.50e+00, at 1.0 and 2.2.\n\n| a | b |\n|---|---|\n| 1 | 2.00 ± 0.10 |"


def test_a_number_that_is_missing_is_an_error_and_no_gap(tmp_path: Path) -> None:
    with pytest.raises(UndefinedError, match="missing"):
        page(tmp_path, "{{ missing }}")


def test_templates_and_data_are_in_the_package() -> None:
    patterns = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["tool"]["setuptools"][
        "package-data"
    ]
    packed = {file for pattern in patterns["runs"] for file in (ROOT / "runs").glob(pattern)}
    beside = {file for file in (ROOT / "runs" / "studies").rglob("*") if file.suffix in (".jinja", ".toml", ".inp")}
    beside |= set((ROOT / "runs" / "reporting").glob("*.jinja"))
    assert len(beside) > 10
    assert beside <= packed
