"""The common part of all studies: compute answers into a folder, make a page from them, and publish it."""

import re
import shutil
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, nullcontext
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from linear_bem.errors import OutputUnusable
from runs.process import ranks, signals
from runs.process.files import read_json, replacing, write_text
from runs.process.json_values import to_json
from runs.process.locks import RUNNING, take
from runs.session.output_folder import FINISHED, LOCK, MARK, difference, ended
from runs.session.progress import print_status
from runs.studies import Options

CASES = "cases"
OUTDATED = ": its saved answer is damaged, of other code or of another case, and is not used"
"""What is said of a case that is solved although its file is there."""
BEGIN, END = "<!-- answer: written by thirdbody study --publish -->", "<!-- end of the answer -->"


@dataclass(frozen=True)
class Study:
    """A study: ``compute`` saves answers in its folder (on every rank), ``page`` makes tables and figures from them.

    The arguments of ``page`` are the folder and whether it is of the quick version; it returns Markdown.
    """

    name: str
    compute: Callable[[Path, Options], None]
    page: Callable[[Path, bool], str]
    publishes: Sequence[str] = ()
    """Files of the output folder that belong on the study's page."""
    text: str = "answer.md"
    """File of the output folder with the page."""
    saves: str = f"{CASES}/*"
    """Pattern of files that identify an unmarked folder as the study's."""
    resumable: bool = True
    """Whether ``compute`` uses what an interrupted run has saved."""


def run(study: Study, options: Options) -> None:
    """Compute the missing answers, then make the page; raises `OutputUnusable`."""
    signals.resumable = study.resumable
    folder = options.out or Path("out") / f"study-{study.name}{'-quick' if options.quick else ''}"
    identity = {"command": "study", "study": study.name, "quick": options.quick}
    if ranks.is_root():  # before MPI starts, so that an unusable folder ends the run at once
        _open(folder, study, identity)
    if not options.tables:
        with _marked(folder, identity) if ranks.is_root() else nullcontext():
            study.compute(folder, options)
    if not ranks.is_root():
        return
    text = study.page(folder, options.quick).rstrip("\n") + "\n"
    write_text(folder / study.text, text)
    print(text, end="")
    if options.publish:
        print_status(f"published in {publish(study.name, text, [folder / name for name in study.publishes])}")
    print_status(f"{study.text}, tables (CSV) and figures are in {folder}")


@contextmanager
def timed(title: str) -> Iterator[None]:
    """Print the beginning of a case and its duration; no case begins after a signal has asked the run to stop."""
    signals.check()
    print_status(title)
    begun = time.monotonic()
    yield
    print_status(f"{title}: {time.monotonic() - begun:.1f} s")


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


def command(name: str, quick: bool) -> str:
    """Return the command that makes the study's page."""
    return f"thirdbody study {name}{' --quick' if quick else ''}"


@contextmanager
def _marked(folder: Path, identity: dict[str, Any]) -> Iterator[None]:
    """Mark the folder as running, and at the end with the outcome, unless another run still shares the folder."""
    state = FINISHED
    try:
        lock = open(folder / LOCK, "w", encoding="utf-8")  # noqa: SIM115  (held as long as the run)
    except OSError as error:
        raise OutputUnusable(f"{folder}: cannot write there: {error.strerror or error}; name another --out") from None
    with lock:
        take(lock, wait=True, shared=True)
        _write_mark(folder, identity, RUNNING)
        try:
            yield
        except BaseException as error:
            state = ended(type(error))
            raise
        finally:
            if take(lock) is not False:
                _write_mark(folder, identity, state)


def _write_mark(folder: Path, identity: dict[str, Any], state: str) -> None:
    write_text(folder / MARK, to_json({"identity": identity, "state": state}))


def _open(folder: Path, study: Study, identity: dict[str, Any]) -> None:
    """Create the folder and mark it as the study's; several runs may share it."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        mark = read_json(folder / MARK)
        others = sorted(path.name for path in folder.iterdir() if not path.name.startswith("."))
        known = mark is not None or set(others) <= {MARK, CASES} or any(folder.glob(study.saves))
    except OSError as error:
        raise OutputUnusable(f"{folder}: cannot write there: {error.strerror or error}; name another --out") from None
    if not known:
        raise OutputUnusable(f"{folder}: holds files of no study ({others[0]}); name a new or empty --out")
    if mark is None:
        _write_mark(folder, identity, FINISHED)
    elif mark.get("identity") != identity:
        raise OutputUnusable(
            f"{folder}: holds another run ({difference(mark.get('identity'), identity)}); name another --out"
        )
