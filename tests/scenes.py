"""Shipped scenes as tests take them: with tables of their own in place of the shipped ones."""

from __future__ import annotations

from tests.launch import ROOT


def thin_pair(accuracy: str = "") -> str:
    """Return the shipped thin pair, with the lines ``accuracy`` as its table `[accuracy]`, or without one."""
    text = (ROOT / "runs" / "scenes" / "paper_thin_pair.toml").read_text(encoding="utf-8")
    kept = text.partition("[accuracy]")[0]
    return f"{kept}[accuracy]\n{accuracy}\n" if accuracy else kept
