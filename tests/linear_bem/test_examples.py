import doctest
import re
from pathlib import Path

import pytest

import linear_bem
import linear_bem.solver

README = (Path(linear_bem.__file__).parent / "README.md").read_text(encoding="utf-8")


@pytest.mark.parametrize("module", [linear_bem, linear_bem.solver], ids=["package", "solver"])
def test_the_examples_in_docstrings_run_as_printed(module):
    failed, tried = doctest.testmod(module)
    assert tried > 0
    assert failed == 0


@pytest.mark.parametrize("code", re.findall(r"```python\n(.*?)```", README, re.DOTALL))
def test_the_examples_in_the_readme_run_and_print_what_their_comments_say(code, capsys):
    exec(compile(code, "README.md", "exec"), {})
    printed = capsys.readouterr().out.strip()
    assert printed
    for shown in re.findall(r"print\(.*\)  # (\S+?)(?::|$)", code, re.MULTILINE):
        assert printed == shown
