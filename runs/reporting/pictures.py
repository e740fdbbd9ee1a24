"""Figures inside the page: SVG inline, other pictures as data, each with a description."""

import base64
import io
import re
from html import escape
from pathlib import Path

from runs.session.output_folder import PICTURES

SHOWN = {
    "tangential_force": "Tangential force over the load; where both models ran, its strengthening by finite strain.",
    "surface": "Contact pressure on the layer's surface from above, and a section through the balls.",
    "forces": "Contacts of many balls from above, coloured by peak pressure, and tangential forces as arrows.",
    "strengthening": "Finite over small strain along the load, separation and attraction case.",
    "parameters": "Strengthening over Poisson's ratio and distance, and the sign of the tangential force.",
    "top_views": "Positions of the balls from above, at the start and later.",
    "distances": "Distances between the balls over the sliding path.",
    "structure": "Sizes of clusters, contacts of a ball, and hexatic order over the sliding path.",
    "evolution": "Motion of the balls, from above.",
    "ensemble": "Outcomes from different starting positions.",
    "pareto": "Error of the tangential force against processor time, with the Pareto front.",
}
"""Descriptions of the pictures of runs and studies by file stem, in the order of the page."""
KINDS = {".png": "image/png", ".gif": "image/gif", ".jpg": "image/jpeg"}
WIDE = 1.5
"""Width over height from which a picture keeps a readable width on a phone and scrolls in a box of its own."""


def pictures_of(folder: Path) -> list[Path]:
    """Return the pictures of a folder, each once, as SVG if available."""
    found = [path for path in sorted(folder.rglob("*")) if path.suffix in (".svg", *KINDS) and path.is_file()]
    found = [p for p in found if not any(part.startswith(".") for part in p.relative_to(folder).parts)]
    vectors = {path.with_suffix("") for path in found if path.suffix == ".svg"}
    once = [path for path in found if path.suffix == ".svg" or path.with_suffix("") not in vectors]
    order = list(SHOWN)
    return sorted(once, key=lambda p: (order.index(p.stem) if p.stem in order else len(order), p.suffix == ".gif"))


def figure(path: Path, number: int, words: str = "") -> str:
    """Return the picture with its caption; ``number`` makes the names inside each SVG unique on the page."""
    words = words or said_of(path)
    if path.suffix == ".svg":
        content, ratio = _inline(path.read_text(encoding="utf-8"), f"figure{number}", words)
    else:
        from PIL import Image  # noqa: PLC0415  (comes with matplotlib)

        data = path.read_bytes()
        width, height = Image.open(io.BytesIO(data)).size
        source = f"data:{KINDS[path.suffix]};base64,{base64.b64encode(data).decode()}"
        content, ratio = f'<img src="{source}" alt="{escape(words)}">', width / height
    shape, words = "wide" if ratio >= WIDE else "tall", escape(words)
    inside = f'<div class="picture {shape}" tabindex="0" role="group" aria-label="{words}">{content}</div>'
    return f"<figure>{inside}<figcaption>{words}</figcaption></figure>"


def said_of(path: Path) -> str:
    """Return the description of a picture by its file name, for pictures of `thirdbody render` and all others."""
    drawn = re.fullmatch(r"(.+)_([a-z]+?)(?:_step_(\d+))?", path.stem)
    if drawn is None or path.parent.name != PICTURES:
        return SHOWN.get(path.stem, path.stem.replace("_", " ").capitalize())
    name, view, step = drawn.groups()
    field = name.replace("_", " ").replace("von mises", "von Mises stress")
    when = f"load step {int(step)}" if step else "along the load path (animation)"
    return f"{field[0].upper()}{field[1:]} in the deformed layer under its balls: {view}, {when}."


def _inline(text: str, prefix: str, words: str) -> tuple[str, float]:
    """Return an SVG element for the inside of a page, and its width over height."""
    text = text[text.index("<svg") :]
    text = re.sub(r"<metadata>.*?</metadata>", "", text, flags=re.DOTALL)
    text = re.sub(r"<(script|foreignObject)\b.*?</\1>", "", text, flags=re.DOTALL)
    text = re.sub(r'\bid="([^"]+)"', rf'id="{prefix}-\1"', text)
    text = re.sub(r'href="#([^"]+)"', rf'href="#{prefix}-\1"', text)
    text = re.sub(r"url\(#([^)]+)\)", rf"url(#{prefix}-\1)", text)
    box = re.search(r'viewBox="([^"]+)"', text)
    size = [float(v) for v in box.group(1).split()] if box else [0.0, 0.0, 1.0, 1.0]
    head, rest = text.split(">", 1)
    head = re.sub(r'\s(width|height)="[^"]*"', "", head)
    return f'{head} role="img" aria-label="{escape(words)}">{rest.strip()}', size[2] / size[3]
