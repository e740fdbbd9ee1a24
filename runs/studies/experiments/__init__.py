"""The study ``experiments``: the source's balls that gather and scatter, beside what it reports of them."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any

from runs.studies import Options


def run(options: Options) -> None:
    """Evolve every case by small strain, and by finite strain where its table is there; print and save the answer."""
    from runs.process import signals  # noqa: PLC0415
    from runs.process.files import replacing  # noqa: PLC0415
    from runs.session.progress import tell  # noqa: PLC0415
    from runs.studies.experiments import cases, report, side_by_side  # noqa: PLC0415
    from runs.studies.framework.publishing import publish  # noqa: PLC0415

    folder = options.out or Path("out") / ("study-experiments" + ("-quick" if options.quick else ""))
    found: dict[str, dict[str, Any]] = {model: {} for model in report.MODELS}
    missing: dict[str, str] = {}
    seconds = 0.0
    for case in cases.CASES:
        if options.quick and not case.essential:
            continue
        scene = case.read(options.quick)
        models = ["linear_bem"]
        if case.finite is not None and cases.has_table(case, scene):
            models.append("finite_strain")
        elif case.finite is not None:
            missing[case.name] = f"mpirun -n 2 thirdbody evolve runs/scenes/experiment_{case.finite}.toml"
        for model in models:
            signals.check()
            begun = time.monotonic()
            document = cases.evolve(
                case, scene, model, folder, fresh=options.fresh, pictures=not options.quick, compute=not options.tables
            )
            if document is None:
                tell(f"{case.name}, {model}: not there")
                continue
            found[model][case.name] = document
            seconds += document["solved"]["seconds"]
            tell(f"{case.name}, {model}: {time.monotonic() - begun:.1f} s")
    report.write_table(folder, found)
    report.draw(folder, found)
    report.draw_gathering(folder, found)
    command = f"thirdbody study experiments{' --quick' if options.quick else ''}"
    text = report.answer(found, missing, side_by_side.comparisons(), command, seconds) + "\n"
    with replacing(folder / "answer.md") as draft:
        draft.write_text(text, encoding="utf-8")
    print(text, end="")
    if options.publish:
        tell(f"published in {publish('experiments', text, [folder / 'experiments.svg', folder / 'gathering.svg'])}")
    tell(f"answer.md, experiments.csv, figures, and a folder per run are in {folder}")
