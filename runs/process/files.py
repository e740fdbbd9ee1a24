"""Files that are written as a whole or not at all."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Iterator
from pathlib import Path

from linear_bem.errors import OutputUnusable


@contextlib.contextmanager
def replacing(target: Path) -> Iterator[Path]:
    """Yield a draft beside ``target`` that takes its place when all went well; raises `OutputUnusable`."""
    draft = target.with_name(f".part.{target.name}")
    try:
        yield draft
        os.replace(draft, target)
    except OSError as error:
        with contextlib.suppress(OSError):
            draft.unlink()
        raise OutputUnusable(f"{target}: cannot be written: {error.strerror or error}; name another --out") from None
