"""The study ``accuracy``: error of T against processor time, over models and over every knob of the solvers."""

from __future__ import annotations

from runs.studies import Options


def run(options: Options) -> None:
    """Solve the cases of `matrix.cases`, then write tables, figure and answer."""
    from runs.studies.accuracy.answer import present  # noqa: PLC0415
    from runs.studies.accuracy.matrix import cases  # noqa: PLC0415
    from runs.studies.framework.runner import Study, run  # noqa: PLC0415

    run(Study("accuracy", cases(options.quick), present, ["pareto.svg", "pareto.png"]), options)
