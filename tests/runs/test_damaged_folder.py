"""A run's folder whose files are damaged: what is safe is computed again, what is not is refused with the remedy."""

from __future__ import annotations

from pathlib import Path

import pytest

from linear_bem.errors import OutputUnusable
from runs.session.output_folder import OutputFolder


def test_a_damaged_mark_is_named_and_replaced_where_asked(tmp_path: Path) -> None:
    out = tmp_path / "out"
    run = OutputFolder(out, {"command": "solve"}, "")
    run.save({"answer": 1}, [])
    run.close()
    (out / "run.json").write_text('{"identity": {"comm', encoding="utf-8")
    with pytest.raises(OutputUnusable, match=r"run\.json: is damaged.*--fresh"):
        OutputFolder(out, {"command": "solve"}, "")
    again = OutputFolder(out, {"command": "solve"}, "", fresh=True)
    assert again.saved() is None
    again.close()


def test_a_damaged_result_is_computed_again(tmp_path: Path) -> None:
    run = OutputFolder(tmp_path / "out", {"command": "solve"}, "")
    run.save({"answer": 1}, [])
    run.finish()
    (tmp_path / "out" / "result.json").write_text('{"answer"', encoding="utf-8")
    assert run.finished() is None
    run.close()
