import doctest
import re
from pathlib import Path

import linear_bem


def test_the_example_in_the_package_docstring_runs_as_printed():
    failed, tried = doctest.testmod(linear_bem)
    assert tried > 0
    assert failed == 0


def test_the_example_in_the_readme_runs_as_printed(capsys):
    text = (Path(linear_bem.__file__).parent / "README.md").read_text(encoding="utf-8")
    code = re.search(r"```python\n(.*?)```", text, re.DOTALL).group(1)
    exec(compile(code, "README.md", "exec"), {})
    assert capsys.readouterr().out.strip() == "-1.1613e-07"
    assert "# -1.1613e-07" in code
