"""Shipped scenes as tests take them: with tables of their own in place of the shipped ones."""

from __future__ import annotations

from tests.launch import ROOT


def thin_pair(accuracy: str = "") -> str:
    """Return the shipped thin pair at the usual load steps, with the lines ``accuracy`` as `[accuracy]`, or without."""
    text = (ROOT / "runs" / "scenes" / "paper_thin_pair.toml").read_text(encoding="utf-8")
    kept = "".join(line for line in text.partition("[accuracy]")[0].splitlines(True) if not line.startswith("steps"))
    return f"{kept}[accuracy]\n{accuracy}\n" if accuracy else kept
