"""The study ``strengthening``: T of finite over small strain, at equal force and approach, and what causes it."""

from __future__ import annotations

from runs.studies import Options


def run(options: Options) -> None:
    """Solve the cases of `matrix.cases`, then write tables, figures and answer."""
    from runs.studies.framework.runner import Study, run  # noqa: PLC0415
    from runs.studies.strengthening.answer import present  # noqa: PLC0415
    from runs.studies.strengthening.matrix import cases  # noqa: PLC0415

    pictures = [f"{name}.{kind}" for name in ("strengthening", "parameters") for kind in ("svg", "png")]
    run(Study("strengthening", cases(options.quick), present, pictures), options)
