"""The study ``discretisations``: work against precision of the elements' order and size, on five unlike scenes."""

from __future__ import annotations

from runs.studies import Options


def run(options: Options) -> None:
    """Solve the cases of `matrix.cases`, then write the table."""
    from runs.studies.discretisations.answer import present  # noqa: PLC0415
    from runs.studies.discretisations.matrix import cases  # noqa: PLC0415
    from runs.studies.framework.runner import Study, run  # noqa: PLC0415

    run(Study("discretisations", cases(options.quick), present), options)
