"""The study ``verification``: the finite-strain model against closed forms, published results, and itself."""

from __future__ import annotations

from runs.studies import Options


def run(options: Options) -> None:
    """Solve the cases of every part, then write tables, figure and answer."""
    from runs.studies.framework.runner import Study, run  # noqa: PLC0415
    from runs.studies.verification.answer import ENDINGS, PARTS, present  # noqa: PLC0415

    cases = [case for part in PARTS for case in part.cases(options.quick)]
    run(Study("verification", cases, present, ["verification.svg", "verification.png"], ENDINGS), options)
