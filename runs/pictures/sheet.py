"""A sheet: a drawn load step with colour bar, scale bar and caption; and sequences of sheets as animations."""

import shutil
import subprocess
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from linear_bem.errors import OutputUnusable
from runs.pictures.coloring import Coloring, prefixed, round_length
from runs.process.files import replacing

Image = NDArray[np.uint8]
_BAND = 0.17
"""Height of the band under the drawing for bars and caption, over the height of the sheet."""
_DPI = 200.0
_FRAME_SECONDS, _LAST_SECONDS = 0.35, 2.0


def drawing_size(size: tuple[int, int]) -> tuple[int, int]:
    """Return the size of the drawing on a sheet of the given size, in pixels."""
    return size[0], size[1] - round(_BAND * size[1])


def compose(
    drawing: Image, seen: float, coloring: Coloring, limits: tuple[float, float], unit: str, caption: str,
    size: tuple[int, int], *, dimensionless: bool,
) -> Image:  # fmt: skip
    """Return the sheet (height, width, 3) of ``size`` with the drawing, whose width is ``seen`` [m], bars and caption.

    The colour bar has the ``limits`` in ``unit``.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg  # noqa: PLC0415  (slow to load, no display needed)
    from matplotlib.cm import ScalarMappable  # noqa: PLC0415
    from matplotlib.colors import Normalize  # noqa: PLC0415
    from matplotlib.figure import Figure  # noqa: PLC0415
    from matplotlib.ticker import MaxNLocator  # noqa: PLC0415

    width, height = size
    points = 11.0 * width / 1600.0
    figure = Figure(figsize=(width / _DPI, height / _DPI), dpi=_DPI, facecolor="white")
    canvas = FigureCanvasAgg(figure)
    factor, unit = prefixed(unit, max(map(abs, limits)), dimensionless)
    low, high = (factor * value for value in limits)
    bar = figure.add_axes((0.27, 0.125, 0.34, 0.026))
    mappable = ScalarMappable(Normalize(low, high), coloring.color_map())
    colors = figure.colorbar(mappable, cax=bar, orientation="horizontal")
    colors.outline.set_linewidth(0.5)
    colors.ax.tick_params(labelsize=points, width=0.5, length=2.5)
    colors.locator = MaxNLocator(5)
    colors.update_ticks()
    colors.set_label(f"{coloring.words} / {unit}" if unit else coloring.words, fontsize=points)
    length = round_length(0.16 * seen)
    scale, metre = prefixed("m", length, dimensionless)
    share = length / seen
    rule = figure.add_axes((0.06, 0.125, share, 0.026))
    rule.set_axis_off()
    rule.set(xlim=(0.0, 1.0), ylim=(0.0, 1.0))
    rule.plot([0.0, 0.0, 1.0, 1.0], [1.0, 0.5, 0.5, 1.0], color="0.15", lw=1.2, clip_on=False)
    figure.text(0.06 + share / 2.0, 0.07, f"{scale * length:g} {metre}", fontsize=points, ha="center", color="0.15")
    figure.text(0.94, 0.07, caption, fontsize=points, ha="right", color="0.15", linespacing=1.5)
    canvas.draw()
    sheet = np.array(canvas.buffer_rgba())[..., :3]
    sheet[: drawing.shape[0]] = drawing
    return sheet


def save_png(sheet: Image, path: Path) -> None:
    """Write a sheet as PNG, atomically."""
    from PIL import Image as Pillow  # noqa: PLC0415  (comes with matplotlib)

    with replacing(path) as draft:
        Pillow.fromarray(sheet).save(draft, format="PNG", optimize=True)


def save_gif(
    sheets: Sequence[Image], path: Path, seconds: float = _FRAME_SECONDS, last: float = _LAST_SECONDS, colors: int = 256
) -> None:
    """Write sheets as an animation that pauses on the last sheet and repeats; ``seconds`` of each, and of the last."""
    from PIL import Image as Pillow  # noqa: PLC0415

    palette = Pillow.fromarray(np.concatenate([sheets[0], sheets[-1]])).quantize(colors)
    frames = [Pillow.fromarray(sheet).quantize(palette=palette, dither=Pillow.Dither.NONE) for sheet in sheets]
    durations = [round(1000.0 * seconds)] * (len(frames) - 1) + [round(1000.0 * last)]
    with replacing(path) as draft:
        frames[0].save(
            draft, format="GIF", save_all=True, append_images=frames[1:], duration=durations, loop=0, optimize=False
        )


def save_mp4(sheets: Sequence[Image], path: Path) -> bool:
    """Write sheets as MP4 if ffmpeg is installed, and return whether it is; raises `OutputUnusable`."""
    program = shutil.which("ffmpeg")
    if program is None:
        return False
    height, width = (n - n % 2 for n in sheets[0].shape[:2])
    rate = round(1.0 / _FRAME_SECONDS)
    held = [*sheets, *([sheets[-1]] * round(_LAST_SECONDS * rate))]
    with replacing(path) as draft:
        command = [
            program, "-y", "-loglevel", "error", "-f", "rawvideo", "-pix_fmt", "rgb24", "-s", f"{width}x{height}",
            "-r", str(rate), "-i", "-", "-c:v", "libx264", "-crf", "16", "-pix_fmt", "yuv420p", "-f", "mp4", str(draft),
        ]  # fmt: skip
        pixels = b"".join(np.ascontiguousarray(sheet[:height, :width]).tobytes() for sheet in held)
        done = subprocess.run(command, input=pixels, capture_output=True, check=False)
        if done.returncode:
            raise OutputUnusable(f"{path}: ffmpeg could not write it: {done.stderr.decode(errors='replace').strip()}")
    return True
