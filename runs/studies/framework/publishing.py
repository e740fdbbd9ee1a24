"""Publish a study's answer: replace the part of its README between two marks, and copy the figures next to it."""

import re
import shutil
from collections.abc import Sequence
from pathlib import Path

from linear_bem.errors import OutputUnusable
from runs.process.files import replacing

BEGIN, END = "<!-- answer: written by thirdbody study --publish -->", "<!-- end of the answer -->"


def publish(name: str, answer: str, files: Sequence[Path], home: Path | None = None) -> Path:
    """Write ``answer`` into the study's README, copy ``files`` beside it, return its path; raises `OutputUnusable`."""
    page = (home or Path(__file__).parents[1] / name) / "README.md"
    try:
        text = page.read_text(encoding="utf-8")
    except OSError as error:
        raise OutputUnusable(f"{page}: cannot be read: {error.strerror}; --publish needs the checkout") from None
    pattern = re.compile(f"{re.escape(BEGIN)}.*?{re.escape(END)}", re.DOTALL)
    if not pattern.search(text):
        raise OutputUnusable(f"{page}: has no place for the answer; put the lines {BEGIN} and {END} into it")
    for file in files:
        if file.exists():
            with replacing(page.with_name(file.name)) as draft:
                shutil.copyfile(file, draft)
    with replacing(page) as draft:
        draft.write_text(pattern.sub(lambda _: f"{BEGIN}\n\n{answer}\n{END}", text, count=1), encoding="utf-8")
    return page
