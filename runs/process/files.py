"""Reading and writing of files; files are replaced atomically."""

import contextlib
import csv
import io
import json
import os
import zlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any
from zipfile import BadZipFile

from linear_bem.errors import OutputUnusable, ThirdBodyError

DAMAGED = (OSError, EOFError, ValueError, KeyError, BadZipFile, zlib.error)
"""Exceptions that numpy raises for a damaged file of arrays."""
DRAFT = ".part."
"""Prefix of the names of incomplete files."""


@contextlib.contextmanager
def replacing(target: Path) -> Iterator[Path]:
    """Yield a draft beside ``target`` that replaces it if the block succeeds; raises `OutputUnusable`.

    Two processes that write the same file have separate drafts; the last one remains.
    """
    draft = target.with_name(f"{DRAFT}{os.getpid()}.{target.name}")
    try:
        yield draft
        os.replace(draft, target)
    except OSError as error:
        raise OutputUnusable(f"{target}: cannot be written: {error.strerror or error}; name another --out") from None
    finally:
        with contextlib.suppress(OSError):
            draft.unlink()


def make_folder(folder: Path) -> None:
    """Make a folder for ``--out`` and the folders above it; raises `OutputUnusable`."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise OutputUnusable(f"{folder}: cannot be made: {error.strerror or error}; name another --out") from None


def write_text(target: Path, text: str) -> None:
    """Write a text file and flush it to the disk; raises `OutputUnusable`."""
    # a name of a file that is no UTF-8 has characters that UTF-8 lacks
    with replacing(target) as draft, open(draft, "w", encoding="utf-8", errors="replace", newline="") as file:
        file.write(text)
        file.flush()
        os.fsync(file.fileno())


def write_csv(target: Path, rows: Sequence[Mapping[str, Any]]) -> None:
    """Write rows of plain values, one column per key; a row may lack some keys.

    A pair, value and error, has two columns: its key, and "error of" it.
    """
    rows, text = [_apart(row) for row in rows], io.StringIO()
    writer = csv.DictWriter(text, list(dict.fromkeys(key for row in rows for key in row)), lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    write_text(target, text.getvalue())


def _apart(row: Mapping[str, Any]) -> dict[str, Any]:
    pairs = {key: value for key, value in row.items() if isinstance(value, tuple)}
    values, errors = {k: v for k, (v, _) in pairs.items()}, {f"error of {k}": e for k, (_, e) in pairs.items()}
    return {**row, **values, **errors}


def read_csv(source: Path, cell: Callable[[str], Any] = str) -> list[dict[str, Any]]:
    """Return the rows of a file written by `write_csv`, each cell converted by ``cell``."""
    with open(source, encoding="utf-8", newline="") as file:
        return [{key: cell(text) for key, text in row.items()} for row in csv.DictReader(file)]


@contextlib.contextmanager
def reading(source: Path) -> Iterator[None]:
    """Name a saved document in whose use the block finds a key missing or wrong; raises `OutputUnusable`."""
    try:
        yield
    except ThirdBodyError:
        raise
    except (AttributeError, LookupError, StopIteration, TypeError, ValueError) as error:
        what = f"lacks the key {error}" if isinstance(error, KeyError) else f"has a wrong value ({error})"
        raise OutputUnusable(
            f"{source}: {what}, perhaps because it was edited or another version wrote it; run the same command again "
            "with --fresh"
        ) from error


def read_json(source: Path) -> dict[str, Any] | None:
    """Return the JSON object in a file; None if it is missing, damaged or not an object."""
    try:
        data = json.loads(source.read_text(encoding="utf-8"))
    except (FileNotFoundError, NotADirectoryError, ValueError):
        return None
    return data if isinstance(data, dict) else None
