"""The command ``report``: one self-contained HTML page for the folder of a run or a study, readable offline."""

import importlib.metadata
import tomllib
from html import escape
from pathlib import Path

from runs.process import ranks
from runs.process.files import write_text
from runs.reporting import run_page, study_page
from runs.reporting.folder import Folder, read_folder
from runs.reporting.markup import code, folded, paragraph, section, tag
from runs.reporting.pictures import figure, pictures_of
from runs.session.terminal import print_status

NAME = "report.html"
STYLE = Path(__file__).with_name("report.css")
"""One column that fits a phone, light and dark; wide tables scroll in their own box."""
KINDS = {
    "solve": "One scene, one model",
    "compare": "Finite against small strain",
    "study": "Study",
    "evolve": "Evolution",
}


def report_folder(path: Path, out: Path | None = None) -> None:
    """Write the page of the folder ``path`` to ``out``; raises `OutputUnusable` where there is nothing to report."""
    if not ranks.is_root():
        return
    target = out or path / NAME
    write_text(target, page_of(read_folder(path)))
    print_status(
        f"the report is {target} ({max(target.stat().st_size / 1e6, 0.01):.2g} MB, no other file is needed to read it)"
    )


def page_of(folder: Folder) -> str:
    """Return the whole page: nothing in it refers to another file or to the network."""
    if folder.command == "study":
        title, parts = _study(folder)
    else:
        title, parts = _run(folder)
    kind = KINDS.get(folder.command, folder.command)
    state = "" if folder.finished or folder.command == "study" else "unfinished: the same command continues it"
    head = tag("p", escape(kind), class_="kind") + tag("h1", escape(title))
    head += paragraph(state, class_="note") if state else ""
    parts.append(section("Reproduce", code(folder.repeat()), _scene(folder)))
    if folder.log:
        parts.append(section("Log", folded("Messages of the run", code(folder.log))))
    version = importlib.metadata.version("thirdbody")
    foot = paragraph(f"Written by thirdbody {version} report. Forces are those on the ball; T > 0 is attraction.")
    return (
        '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f"<title>{escape(title)}</title>\n<style>\n{STYLE.read_text(encoding='utf-8')}</style>\n</head>\n<body>\n"
        f"<header>{head}</header>\n<main>\n{chr(10).join(part for part in parts if part)}\n</main>\n"
        f"<footer>{foot}</footer>\n</body>\n</html>\n"
    )


def _study(folder: Folder) -> tuple[str, list[str]]:
    words = folder.words()
    text = words.read_text(encoding="utf-8") if words is not None else ""
    name = str(folder.identity["study"])
    if not text:
        waiting = paragraph("The study has not come to its tables yet; `--tables` makes them.", class_="note")
        return name, [waiting, study_page.account(folder)]
    html, shown = study_page.answer(folder, text)
    left = [path for path in pictures_of(folder.path) if path not in shown and "cases" not in path.parts]
    more = "".join(figure(path, number) for number, path in enumerate(left, start=len(shown) + 1))
    return study_page.title(text) or name, [html, section("More figures", more), study_page.account(folder)]


def _run(folder: Folder) -> tuple[str, list[str]]:
    parts = run_page.content(folder)
    figures = "".join(figure(path, number) for number, path in enumerate(pictures_of(folder.path), start=1))
    after = next((i for i, part in enumerate(parts) if part.startswith("<section")), len(parts))
    parts.insert(after, section("Figures", figures))
    return _title(folder), parts


def _title(folder: Folder) -> str:
    try:
        title = tomllib.loads(folder.scene_text).get("title", "")
    except tomllib.TOMLDecodeError:
        title = ""
    return str(title) or folder.path.resolve().name


def _scene(folder: Folder) -> str:
    return folded("The scene as given", code(folder.scene_text)) if folder.scene_text.strip() else ""
