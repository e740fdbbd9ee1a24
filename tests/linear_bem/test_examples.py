import doctest
import re
from pathlib import Path

import linear_bem


def test_the_packages_example_prints_what_it_says():
    failed, tried = doctest.testmod(linear_bem)
    assert tried > 0
    assert failed == 0


def test_the_readmes_example_prints_what_it_says(capsys):
    text = (Path(linear_bem.__file__).parent / "README.md").read_text(encoding="utf-8")
    code = re.search(r"```python\n(.*?)```", text, re.DOTALL).group(1)
    exec(compile(code, "README.md", "exec"), {})
    assert capsys.readouterr().out.strip() == "-1.1613e-07"
    assert "# -1.1613e-07" in code
