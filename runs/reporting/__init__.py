"""The command ``report``: one self-contained HTML page for the folder of a run or a study, readable offline."""

import contextlib
import importlib.metadata
import tomllib
from pathlib import Path
from typing import Any

from runs.process import ranks
from runs.process.files import make_folder, reading, write_text
from runs.process.locks import RUNNING, STOPPED
from runs.reporting import run_page, study_page
from runs.reporting.folder import Folder, read_folder
from runs.reporting.markup import render
from runs.reporting.pictures import figure, pictures_of
from runs.session.output_folder import FAILED, INTERRUPTED, REPORT, RESULT
from runs.session.terminal import print_status

STYLE = Path(__file__).with_name("report.css")
"""Style sheet: one column that fits a phone, light and dark; wide tables scroll in a box of their own."""
UNFINISHED = {
    RUNNING: "apparently still running",
    STOPPED: "killed, or its machine failed; the same command completes it",
    INTERRUPTED: "interrupted; the same command completes it",
    FAILED: "failed; the same command tries again",
}
"""Text on the page about an incomplete run, by its state."""
KINDS = {
    "solve": "One scene, one model",
    "compare": "Finite against small strain",
    "study": "Study",
    "evolve": "Evolution",
}


def report_folder(path: Path, out: Path | None) -> None:
    """Write the page of the folder ``path`` to ``out`` (None: into the folder).

    Raises `OutputUnusable` if there is nothing to report.
    """
    if not ranks.is_root():
        return
    target, page = out or path / REPORT, page_of(read_folder(path))
    make_folder(target.parent)
    write_text(target, page)
    print_status(f"the report is {target} ({max(target.stat().st_size / 1e6, 0.01):.2g} MB, self-contained)")


def page_of(folder: Folder) -> str:
    """Return the page as HTML that refers to no other file and not to the network.

    Raises `OutputUnusable` if a key of a run's result is missing or wrong.
    """
    is_study = folder.command == "study"
    with contextlib.nullcontext() if is_study else reading(folder.path / RESULT):
        return _page_of(folder, is_study)


def _page_of(folder: Folder, is_study: bool) -> str:
    # older versions always marked a study as running
    unfinished = "" if is_study and folder.state == RUNNING else UNFINISHED.get(folder.state, "")
    pictures = pictures_of(folder.path)
    study, run, shown = dict[str, Any](), dict[str, Any](), list[Path]()
    if is_study:
        title, html, shown = study_page.answer(folder)
        pictures = [path for path in pictures if path not in shown and "cases" not in path.parts]
        title = title or str(folder.identity["study"])
        study = {"html": html, "cases": study_page.cases(folder)}
    else:
        title, run = _title(folder), run_page.content(folder)
    return render(
        title=title, kind=KINDS.get(folder.command, folder.command), unfinished=unfinished,
        drifts=folder.command == "evolve",
        study=study, run=run, pictures=[figure(path, n) for n, path in enumerate(pictures, start=len(shown) + 1)],
        repeat=folder.repeat(), scene=folder.scene_text, log=folder.log,
        style=STYLE.read_text(encoding="utf-8"), version=importlib.metadata.version("thirdbody"),
    )  # fmt: skip


def _title(folder: Folder) -> str:
    try:
        title = tomllib.loads(folder.scene_text).get("title", "")
    except tomllib.TOMLDecodeError:
        title = ""
    return str(title) or folder.path.resolve().name
