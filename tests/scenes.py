"""Shipped scenes with some tables replaced for tests."""

from __future__ import annotations

from tests.launch import ROOT


def thin_pair(accuracy: str = "") -> str:
    """Return the shipped thin pair with default load steps, and ``accuracy`` as the lines of `[accuracy]` if given."""
    text = (ROOT / "runs" / "scenes" / "paper_thin_pair.toml").read_text(encoding="utf-8")
    kept = "".join(line for line in text.partition("[accuracy]")[0].splitlines(True) if not line.startswith("steps"))
    return f"{kept}[accuracy]\n{accuracy}\n" if accuracy else kept
