"""The published results, from sources.toml."""

import tomllib
from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True)
class Source:
    """A published result: ``states`` was read at the address ``read``; ``remark``: its errors or open questions."""

    citation: str
    states: str
    read: str
    doi: str = ""
    remark: str = ""


_read = tomllib.loads(Path(__file__).with_suffix(".toml").read_text(encoding="utf-8"))
SOURCES = {key: Source(**source) for key, source in _read["sources"].items()}
NOT_OPENED: dict[str, str] = _read["not_opened"]
"""Publications that were sought but could not be read, with the reason."""
