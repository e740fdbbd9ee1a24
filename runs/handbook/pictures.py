"""The pictures of README, physics and gallery: ``python -m runs.handbook.pictures`` (minutes; DOLFINx and pyvista).

Runs the paper's thin pair at finite strain and the nine balls of the tutorial, renders them, and writes small copies.
"""

import re
from pathlib import Path

from PIL import Image, ImageSequence

from runs.commands.compare import compare_scene
from runs.commands.render import render_run
from runs.evolution.evolving import evolve_scene
from runs.handbook import sketch
from runs.handbook.tutorials import ROOT
from runs.scene.scene_file import read_scene
from runs.session.session import Options

OUT = Path("out/pictures")
PICTURES = Path(__file__).with_name("pictures")
WIDTH, FRAMES_KEPT, COLORS = 1100, 2, 24
"""Size of the still in pixels; interval of the frames of the animation that are kept, and their number of colours."""


def draw_layer() -> None:
    """Write deformed_layer.png."""
    run = OUT / "pair"
    compare_scene(read_scene(ROOT / "runs" / "scenes" / "paper_thin_pair.toml"), Options(out=run))
    (made,) = render_run(run, views=("cut",), animation=False)
    picture = Image.open(made).convert("RGB")
    picture = picture.resize((WIDTH, round(WIDTH * picture.height / picture.width)), Image.Resampling.LANCZOS)
    picture.quantize(128).save(PICTURES / "deformed_layer.png", optimize=True)


def draw_gathering() -> None:
    """Write nine_balls.gif, from the scene of the tutorial."""
    page = (Path(__file__).parent / "pages" / "tutorials" / "nine_balls.md").read_text(encoding="utf-8")
    found = re.search(r"^```toml\n(.*?)^```$", page, re.DOTALL | re.MULTILINE)
    assert found is not None
    OUT.mkdir(parents=True, exist_ok=True)
    scene = OUT / "nine_balls.toml"
    scene.write_text(found[1], encoding="utf-8")
    evolve_scene(read_scene(scene), None, Options(out=OUT / "nine"), OUT / "pair-tables")
    animation = Image.open(OUT / "nine" / "evolution.gif")
    frames = [f.convert("RGB").quantize(COLORS) for f in ImageSequence.Iterator(animation)][::FRAMES_KEPT]
    frames[0].save(
        PICTURES / "nine_balls.gif", save_all=True, append_images=frames[1:], duration=200, loop=0, optimize=True
    )


if __name__ == "__main__":
    PICTURES.mkdir(exist_ok=True)
    sketch.draw(PICTURES)
    draw_gathering()
    draw_layer()
