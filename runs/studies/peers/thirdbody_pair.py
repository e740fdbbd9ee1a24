"""The pair by `thirdbody solve`, with a requested relative accuracy of T."""

import json
import subprocess
import sys
import tempfile
from importlib.metadata import version
from pathlib import Path

from runs.studies.peers.scene import POISSON, THICKNESS, YOUNG, report

SCENE = Path(__file__).with_name("pair.toml")


def main(approach: float, size: str) -> None:
    """Solve for T to the relative accuracy ``size``, and print the answer."""
    with tempfile.TemporaryDirectory() as name:
        scene = Path(name) / "pair.toml"
        given = {"thickness": THICKNESS, "young": YOUNG, "poisson": POISSON, "approach": approach, "accuracy": size}
        scene.write_text(SCENE.read_text(encoding="utf-8").format(**given), encoding="utf-8")
        command = [sys.executable, "-c", "from runs.entry import main; main()", "solve", str(scene), "--json"]
        done = subprocess.run([*command, "--out", f"{name}/out"], check=True, stdout=subprocess.PIPE)
    result = json.loads(done.stdout)
    ball, solved = result["balls"][1], result["solved"]
    orders = ", ".join(str(mesh["order"]) for mesh in solved["accuracy"]["meshes"])
    text = f"asked for {size}; orders {orders}"
    force = ball["tangential_force"][0]
    report("thirdbody", version("thirdbody"), approach, text, solved["unknowns"], ball["normal_force"], force)
