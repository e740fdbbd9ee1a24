"""The published results, from sources.toml."""

import tomllib
from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True)
class Source:
    """A published result: ``read`` is the address where ``states`` was read; ``remark`` says what is wrong or open."""

    citation: str
    states: str
    read: str
    doi: str = ""
    remark: str = ""


_read = tomllib.loads(Path(__file__).with_suffix(".toml").read_text(encoding="utf-8"))
SOURCES = {key: Source(**source) for key, source in _read["sources"].items()}
NOT_OPENED: dict[str, str] = _read["not_opened"]
"""What was looked for and could not be read, and why."""
