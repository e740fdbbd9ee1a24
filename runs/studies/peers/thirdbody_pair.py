"""The pair by `thirdbody solve`, with a required relative accuracy of T."""

import json
import subprocess
import sys
import tempfile
from importlib.metadata import version
from pathlib import Path

from runs.studies.peers.scene import THICKNESS, YOUNG, report
from runs.studies.strengthening.materials import LAW_BY_NAME

SCENE = Path(__file__).with_name("pair.toml")


def scene_text(approach: float, accuracy: str, law: str) -> str:
    """Return the scene file for an approach, an accuracy and a law of `LAW_BY_NAME`."""
    chosen, poisson = LAW_BY_NAME[law]
    numbers = {name: list(value) if isinstance(value, tuple) else value for name, value in vars(chosen).items()}
    lines = "\n".join([f'law = "{chosen.name}"', *(f"{name} = {value}" for name, value in numbers.items())])
    given = {"thickness": THICKNESS, "young": YOUNG, "poisson": poisson, "approach": approach, "accuracy": accuracy}
    return SCENE.read_text(encoding="utf-8").format(**given, law=lines)


def main(approach: float, size: str, law: str = "neo_hookean-0.48") -> None:
    """Solve for T to the relative accuracy ``size`` under a law of `LAW_BY_NAME`, and print the answer."""
    with tempfile.TemporaryDirectory() as name:
        scene = Path(name) / "pair.toml"
        scene.write_text(scene_text(approach, size, law), encoding="utf-8")
        command = [sys.executable, "-c", "from runs.entry import main; main()", "solve", str(scene), "--json"]
        done = subprocess.run([*command, "--out", f"{name}/out"], check=True, stdout=subprocess.PIPE)
    result = json.loads(done.stdout)
    ball, solved = result["balls"][1], result["solved"]
    orders = ", ".join(str(mesh["order"]) for mesh in solved["accuracy"]["meshes"])
    text = f"asked for {size}; orders {orders}"
    force, code = ball["tangential_force"][0], ("thirdbody", version("thirdbody"))
    error = {
        "tangential_force_error": ball["tangential_force_error"],
        "normal_force_error": result["steps"][-1]["record"]["normal_force_error"][1],
    }
    report(*code, approach, text, solved["unknowns"], ball["normal_force"], force, **error)
