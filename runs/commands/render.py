"""The command ``render``: pictures of a run's deformed layer under its balls, and an animation of the load path."""

import ctypes
import importlib.util
import os
import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from linear_bem.errors import InvalidProblem, MissingDependency
from runs.commands.doctor import INSTALL_PICTURES
from runs.display.numbers import number
from runs.pictures import sheet
from runs.pictures.coloring import COLORINGS, prefixed
from runs.pictures.drawing import VIEWS, Camera, Window, draw, in_line
from runs.pictures.whole_model import FOLDER, write_whole
from runs.pictures.written_step import WrittenStep, read_step, step_files
from runs.process import ranks
from runs.process.files import make_folder
from runs.session.output_folder import PICTURES
from runs.session.terminal import print_status

INSTALL = f"{INSTALL_PICTURES} (in an environment of your own: pip install 'thirdbody[render]')"
SIZE = (1600, 1000)
FRAME = (960, 600)


def render_run(
    run: Path, *, field: str = "von_mises", views: Sequence[str] = tuple(VIEWS), step: int | None = None,
    out: Path | None = None, animation: bool = True, size: tuple[int, int] = SIZE, whole: bool = False,
) -> list[Path]:  # fmt: skip
    """Draw the fields that a run has written and return the picture files.

    ``step``: None is the last one; ``size`` in pixels; ``whole``: write the whole scene's fields for ParaView instead.
    """
    if not ranks.is_root():
        return []
    _check(field, views, size)
    files = step_files(run)
    if whole:
        index = write_whole(files, out or files[max(files)].parent / FOLDER)
        print_status(f"the whole scene, step by step, for ParaView and meshio: {index}")
        return [index]
    last = step if step is not None else max(files)
    if last not in files:
        raise InvalidProblem(f"--step {last}: {run} holds steps {', '.join(map(str, sorted(files)))}")
    _check_vtk()
    out = out or run / PICTURES
    make_folder(out)
    shown = _Shown(in_line(read_step(files[last], last, field)), field)
    made = list[Path]()

    def drawn(path: Path) -> None:
        made.append(path)
        print_status(f"drawn: {path}")

    for view in views:
        path = out / f"{field}_{view}_step_{last:04d}.png"
        sheet.save_png(shown.sheet(shown.last, view, size), path)
        drawn(path)
    path_so_far = [n for n in sorted(files) if n <= last]
    if animation and len(path_so_far) > 1:
        frame = (min(FRAME[0], size[0]), min(FRAME[1], size[1]))
        sheets = [shown.sheet(in_line(read_step(files[n], n, field)), views[0], frame) for n in path_so_far]
        path = out / f"{field}_{views[0]}.gif"
        sheet.save_gif(sheets, path)
        drawn(path)
        if sheet.save_mp4(sheets, path.with_suffix(".mp4")):
            drawn(path.with_suffix(".mp4"))
    return made


def read_size(text: str) -> tuple[int, int]:
    """Return width and height in pixels from "1600x1000"."""
    sides = text.lower().split("x")
    if len(sides) != 2 or not all(side.isdecimal() for side in sides):
        raise InvalidProblem(f'--size {text}: must be width x height in pixels, such as "1600x1000"')
    return int(sides[0]), int(sides[1])


class _Shown:
    """One field drawn at every load step with the colour limits of the last one."""

    def __init__(self, last: WrittenStep, field: str) -> None:
        self.last, self.field, self.coloring = last, field, COLORINGS[field]
        layer = last.of_layer  # the substrate is drawn grey
        seen = Window.around(last).contains(last.points[layer])
        self.limits = self.coloring.limits(self._values(last)[layer][seen])

    def _values(self, step: WrittenStep) -> NDArray[np.float64]:
        return self.coloring.number(step.fields[self.field])

    def sheet(self, step: WrittenStep, view: str, size: tuple[int, int]) -> NDArray[np.uint8]:
        """Return the sheet (height, width, 3) of one step."""
        width, height = sheet.drawing_size(size)
        picture = draw(step, self._values(step), self.coloring, self.limits, view, (width, height))
        camera = Camera.on(step, view, width / height)
        seen = 2.0 * camera.half_height * width / height
        deepest = max(step.balls, key=lambda ball: ball.approach)
        over = f"{number(deepest.approach / step.balls[0].radius, 3)} R"
        factor, metre = prefixed("m", deepest.approach, step.dimensionless)
        own = "" if step.dimensionless else f"{number(factor * deepest.approach)} {metre} = "
        caption = f"step {step.number}:  D = {own}{over}"
        unit = step.units[self.field]
        return sheet.compose(
            picture, seen, self.coloring, self.limits, unit, caption, size, dimensionless=step.dimensionless
        )


def _check(field: str, views: Sequence[str], size: tuple[int, int]) -> None:
    faults = [] if field in COLORINGS else [f"--field {field}: is none of {', '.join(COLORINGS)}"]
    faults += [f"--view {view}: is none of {', '.join(VIEWS)}" for view in views if view not in VIEWS]
    if min(size) < 200 or max(size) > 8000:
        faults.append(f"--size {size[0]}x{size[1]}: each side must have 200 to 8000 pixels")
    if faults:
        raise InvalidProblem(*faults)


def _check_vtk() -> None:
    """Raise `MissingDependency` if pyvista or an off-screen renderer is missing; select the off-screen renderer."""
    if importlib.util.find_spec("pyvista") is None:
        raise MissingDependency(f"render needs pyvista, not importable by {sys.executable}; install it: {INSTALL}")
    if os.environ.get("DISPLAY") or "VTK_DEFAULT_OPENGL_WINDOW" in os.environ:
        return
    try:
        ctypes.CDLL("libEGL.so.1")
    except OSError as error:
        raise MissingDependency(
            f"render needs libEGL to draw without a screen ({error}); as root: apt-get install libegl1"
        ) from None
    os.environ["VTK_DEFAULT_OPENGL_WINDOW"] = "vtkEGLRenderWindow"  # otherwise VTK tries a display first and warns
