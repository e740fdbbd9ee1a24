"""The command that builds the handbook: ``python -m runs.handbook.build``, or ``bash runs/handbook/build.sh``.

The pages in ``pages/`` are copied to a folder of sources, where the tutorials are run. Further pages are generated from
the code (scene file, command line, live page) or copied from elsewhere in the project (studies, derivations, rules for
contributors). Sphinx turns all of them into HTML; its warnings are errors.
"""

import os
import re
import shutil
import sys
from pathlib import Path

from runs.handbook import command_reference, scene_reference
from runs.handbook.live import widget
from runs.handbook.notebook import notebook
from runs.handbook.tutorials import ROOT, Tutorial
from runs.studies import STUDIES
from runs.studies.framework.page import markdown

HERE = Path(__file__).resolve().parent
PAGES = HERE / "pages"
OUT = Path("out/handbook")
ELSEWHERE = {
    "linear_bem/README.md": "linear_model.md",
    ".github/CONTRIBUTING.md": "contributing.md",
    **{f"runs/studies/{name}/README.md": f"studies/{name}.md" for name in STUDIES},
}
"""Files of the project that are also pages of the handbook."""
ANSWER = "<!-- answer:"
SENTENCE = r"(?:[^.\n]|\.\d|\n(?!\n))*\.(?:\*\*)?(?=\s)"
OPENING = re.compile(rf"^(?:\*\*|Of \d|Finite strain strengthens ){SENTENCE}", re.MULTILINE)
"""A published answer that opens with a sentence, not with a table."""
ANSWERED = re.compile(rf"^\*\*Answer\.\*\* (?:\([^)]*\) )?({SENTENCE})", re.MULTILINE)
"""An answer in words on a study's page, before the published results."""
TABLE = re.compile(r"<!-- studies:.*?-->", re.DOTALL)
HEADING, TITLE = re.compile(r"^(#+ )", re.MULTILINE), re.compile(r"^# ", re.MULTILINE)
LINK = re.compile(r"\]\((?P<target>\.\./[^)#\s]+)(?P<part>#[^)]*)?\)")


def prepare(sources: Path, run_tutorials: bool = True) -> None:
    """Write every page into ``sources``; raises `TutorialFailed`."""
    shutil.rmtree(sources, ignore_errors=True)
    shutil.copytree(PAGES, sources)
    for name, text in (("scene.md", scene_reference.page()), ("commands.md", command_reference.page())):
        (sources / name).write_text(text, encoding="utf-8")
    for name, page in ELSEWHERE.items():
        target = sources / page
        target.parent.mkdir(exist_ok=True)
        target.write_text(with_one_title((ROOT / name).read_text(encoding="utf-8")), encoding="utf-8")
        for picture in (found for kind in ("svg", "png", "gif") for found in (ROOT / name).parent.glob(f"*.{kind}")):
            shutil.copy(picture, target.parent)
    validation = sources / "validation.md"
    text = validation.read_text(encoding="utf-8")
    validation.write_text(TABLE.sub(lambda _: study_table(), text), encoding="utf-8")
    live = sources / "live.md"
    live.write_text(widget.with_errors(live.read_text(encoding="utf-8")), encoding="utf-8")
    (sources / "live_widget.html").write_text(widget.html(), encoding="utf-8")
    if run_tutorials:
        work = sources.parent / "work"
        shutil.rmtree(work, ignore_errors=True)  # its finished runs would be shown again, though the code has changed
        for tutorial in tutorials():
            copy = sources / "tutorials" / tutorial.name
            text = Tutorial(tutorial, work, copy.parent).run()
            copy.with_suffix(".ipynb").write_text(notebook(text), encoding="utf-8")
            copy.write_text(f"{text}\n{{download}}`This page as a notebook <{copy.stem}.ipynb>`\n", encoding="utf-8")
    originals = {sources / page: ROOT / name for name, page in ELSEWHERE.items()}
    originals |= {sources / page.relative_to(PAGES): page for page in PAGES.rglob("*.md")}
    for copy, original in originals.items():
        copy.write_text(linked(copy.read_text(encoding="utf-8"), original, copy, sources), encoding="utf-8")


def with_one_title(page: str) -> str:
    """Return a study's page with the title of its published answer, if any, one level below the page's own title."""
    own, mark, answer = page.partition(ANSWER)
    return own + mark + (HEADING.sub(r"#\1", answer) if TITLE.search(answer) else answer)


def study_table() -> str:
    """Return the table of all studies: question, and the opening sentence of the published answer, if any."""
    rows = []
    for name, question in STUDIES.items():
        own, _, published = (ROOT / "runs/studies" / name / "README.md").read_text(encoding="utf-8").partition(ANSWER)
        written, found = ANSWERED.search(own), OPENING.search(published)
        answer = written[1] if written else found[0] if found else "tables and figures on its page"
        said = " ".join(answer.replace("**", "").split())
        rows.append({"study and question": f"[{name}](studies/{name}.md): {question}", "published answer": said})
    return "\n".join(markdown(rows, aligned=False))


def linked(text: str, original: Path, copy: Path, sources: Path) -> str:
    """Return a page's text with links adapted to its copy in ``sources``; its pictures are copied there."""

    def found(link: re.Match[str]) -> str:
        file = (original.parent / link["target"]).resolve()
        name = file.relative_to(ROOT).as_posix()
        if file.is_relative_to(PAGES):
            target = sources / file.relative_to(PAGES)
        elif name in ELSEWHERE:
            target = sources / ELSEWHERE[name]
        else:
            target = sources / file.name
            shutil.copy(file, target)
        return f"]({os.path.relpath(target, copy.parent)}{link['part'] or ''})"

    return LINK.sub(found, text)


def tutorials() -> list[Path]:
    """Return the tutorials in the order of their index; a tutorial may use the runs of earlier ones."""
    index = (PAGES / "tutorials" / "index.md").read_text(encoding="utf-8")
    return [PAGES / "tutorials" / f"{name}.md" for name in re.findall(r"^([a-z_]+)$", index, re.MULTILINE)]


def build(out: Path = OUT, run_tutorials: bool = True) -> int:
    """Build ``out``/html and return Sphinx's exit code."""
    from sphinx.cmd.build import main  # noqa: PLC0415  (only the handbook needs it)

    prepare(out / "sources", run_tutorials)
    options = ["-q", "-W", "--keep-going", "-b", "html", "-c", str(HERE), "-d", str(out / "doctrees")]
    return int(main([*options, str(out / "sources"), str(out / "html")]))


if __name__ == "__main__":
    code = build()
    if code == 0:
        print(f"handbook: {(OUT / 'html' / 'index.html').resolve()}")
    sys.exit(code)
