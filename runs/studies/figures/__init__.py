"""The study ``figures``: the paper's figures 8 to 12 and maps of the sign of T, with the numbers they show."""

from __future__ import annotations

import importlib
import time
from pathlib import Path
from typing import Any

from runs.studies import Options

PARTS = ("bulge", "pressure", "thickness", "modulus", "distance", "map_lengths", "map_materials")


def run(options: Options) -> None:
    """Compute and draw every part, write figures.md, and print it."""
    from runs.display.style import look, save_figure  # noqa: PLC0415
    from runs.process import signals  # noqa: PLC0415
    from runs.session.progress import tell  # noqa: PLC0415
    from runs.session.run_folder import RunFolder  # noqa: PLC0415
    from runs.studies.figures import part as parts  # noqa: PLC0415
    from runs.studies.figures.pair import scene  # noqa: PLC0415
    from runs.studies.figures.report import report  # noqa: PLC0415

    version = {"quick": options.quick, "code": parts.fingerprint()}
    identity = {"command": "study", "study": "figures", "quick": options.quick}
    folder = RunFolder(options.out or Path("out/study-figures"), identity, scene().text, fresh=options.fresh)
    done: list[tuple[parts.Part, parts.Findings]] = []
    for name in PARTS:
        signals.check()
        part: parts.Part = importlib.import_module(f"runs.studies.figures.{name}").PART
        found = None if options.fresh else parts.saved(folder.path, part.stem, version)
        if found is None:
            found = _made(part, options.quick)
            with look():
                save_figure(part.draw(found), folder.path, part.stem)
            parts.save(folder.path, part.stem, version, found)
            tell(f"{part.title}: {found.seconds:.1f} s")
        else:
            tell(f"{part.title}: taken from {folder.path}")
        done.append((part, found))
    print(report(folder.path, done, quick=options.quick))
    folder.finish()
    folder.close()
    tell(f"figures, tables (CSV) and figures.md are in {folder.path}")


def _made(part: Any, quick: bool) -> Any:
    begun = time.process_time()
    found = part.compute(quick)
    return type(found)(found.tables, found.numbers, time.process_time() - begun)
