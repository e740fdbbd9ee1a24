"""The study ``effects``: what each optional effect adds and costs, and that a scene without it pays nothing."""

from __future__ import annotations

from runs.studies import Options


def run(options: Options) -> None:
    """Measure every effect, write effects.md and effects.csv, and print the answer."""
    from runs.studies.effects.answer import answer  # noqa: PLC0415

    answer(options)
