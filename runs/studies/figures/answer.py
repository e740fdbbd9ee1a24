"""Every figure with its sentences and numbers: each part is computed once and drawn from its saved results."""

import importlib.metadata
import platform
import time
from pathlib import Path

from runs.display.style import look, save_figure
from runs.process.files import write_text
from runs.session.progress import print_status
from runs.studies import Options
from runs.studies.figures import bulge, distance, map_lengths, map_materials, modulus, pressure, thickness
from runs.studies.figures.pair import scene
from runs.studies.figures.part import save, saved
from runs.studies.framework.page import render
from runs.studies.framework.study import Study, command, timed

PARTS = (
    bulge.PART, pressure.PART, thickness.PART, modulus.PART, distance.PART, map_lengths.PART, map_materials.PART,
)  # fmt: skip
"""In the order of the page."""


def compute(folder: Path, options: Options) -> None:
    """Compute every part without saved results of the same code."""
    write_text(folder / "scene.toml", scene().text)
    for part in PARTS:
        if not options.fresh and saved(folder, part, options.quick) is not None:
            print_status(f"{part.title}: taken from {folder}")
            continue
        with timed(part.title):
            begun = time.process_time()
            found = part.compute(options.quick)
            save(folder, part, options.quick, found, time.process_time() - begun)


def page(folder: Path, quick: bool) -> str:
    """Draw every saved part; return its sentences as Markdown."""
    there = [(part, found) for part in PARTS if (found := saved(folder, part, quick)) is not None]
    for part, found in there:
        with look():
            save_figure(part.draw(found), folder, part.stem)
    return render(
        __file__, command=command("figures", quick),
        seconds=sum(found.seconds for _, found in there),
        versions=", ".join(f"{name} {importlib.metadata.version(name)}" for name in ("thirdbody", "numpy", "scipy")),
        python=platform.python_version(),
        parts=[(part, found.numbers) for part, found in there],
    )  # fmt: skip


STUDY = Study("figures", compute, page, text="figures.md", saves="figure_*.json")
