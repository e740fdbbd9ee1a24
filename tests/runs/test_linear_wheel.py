"""The wheel of the linear core: nothing but `linear_bem` in it, and it solves where nothing else is installed."""

from __future__ import annotations

import importlib.metadata
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

from runs.linear_wheel import build

ALONE = """
import sys
sys.path[:0] = [sys.argv[1]]
import linear_bem
assert linear_bem.__file__.startswith(sys.argv[1]), linear_bem.__file__
pair = tuple(linear_bem.Ball((x, 0.0), 1.0, "paraboloid") for x in (-1.0, 1.0))
load = linear_bem.Load("force", (2.66666e-3,) * 2)
problem = linear_bem.Problem(linear_bem.Layer(1.0, 0.48, 1.16), pair, load, linear_bem.Elastic(1e3, 0.3))
print(f"{linear_bem.solve(problem).balls[0].tangential_force[0]:.4e}")
assert not [name for name in sys.modules if name.split(".")[0] in ("runs", "meshes", "finite_strain")]
"""


@pytest.mark.skipif(not importlib.metadata.packages_distributions().get("setuptools"), reason="needs setuptools")
def test_the_wheel_of_the_linear_core_holds_it_alone_and_solves(tmp_path: Path) -> None:
    wheel = build(tmp_path)
    with zipfile.ZipFile(wheel) as file:
        tops = {name.split("/")[0].split("-")[0] for name in file.namelist()}
        assert tops == {"linear_bem", "thirdbody_linear"}
        (metadata,) = (n for n in file.namelist() if n.endswith("METADATA"))
        text = file.read(metadata).decode()
        assert "Requires-Dist: numpy" in text
        assert "pydantic" not in text
        file.extractall(tmp_path / "site")
    # -I: neither this checkout nor its environment variables are seen
    done = subprocess.run(
        [sys.executable, "-I", "-c", ALONE, str(tmp_path / "site")],
        capture_output=True, text=True, check=False, cwd=tmp_path, timeout=120.0,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert done.stdout.strip() == "-1.1613e-07"
