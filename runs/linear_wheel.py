"""Builds a wheel of `linear_bem` alone, which needs only numpy and scipy.

    python -m runs.linear_wheel [DIR]      # default: dist

The distribution is called ``thirdbody-linear``; version, licence and requirements are those of the project. Do not
install it together with ``thirdbody``, which contains the same package.
"""

import shutil
import subprocess
import sys
import tempfile
import tomllib
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
NAME = "thirdbody-linear"
PYPROJECT = """[build-system]
requires = {requires}
build-backend = "setuptools.build_meta"

[project]
name = "{name}"
version = "{version}"
description = "Small-strain contact of rigid balls with a layered half-space"
readme = "linear_bem/README.md"
requires-python = "{python}"
license = {{ file = "LICENSE" }}
dependencies = {dependencies}

[tool.setuptools.packages.find]
include = ["linear_bem*"]

[tool.setuptools.package-data]
linear_bem = ["py.typed"]
"""


def build(folder: Path) -> Path:
    """Build the wheel in ``folder`` and return it; needs pip, setuptools and wheel, and no network."""
    settings = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    project = settings["project"]
    with tempfile.TemporaryDirectory() as place:
        source = Path(place)
        shutil.copytree(ROOT / "linear_bem", source / "linear_bem", ignore=shutil.ignore_patterns("__pycache__"))
        shutil.copy(ROOT / "LICENSE", source)
        text = PYPROJECT.format(
            requires=settings["build-system"]["requires"],
            name=NAME,
            version=project["version"],
            python=project["requires-python"],
            dependencies=project["dependencies"],
        )
        (source / "pyproject.toml").write_text(text, encoding="utf-8")
        pip = [sys.executable, "-m", "pip", "wheel", "--quiet", "--no-deps", "--no-build-isolation"]
        subprocess.run([*pip, "--wheel-dir", str(folder), str(source)], check=True)
    (wheel,) = folder.glob(f"{NAME.replace('-', '_')}-{project['version']}-*.whl")
    return wheel


if __name__ == "__main__":
    print(build(Path(sys.argv[1] if len(sys.argv) > 1 else "dist")))
