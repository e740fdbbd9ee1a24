"""What a report refuses: folders without a run and damaged files."""

from __future__ import annotations

from pathlib import Path

import pytest

from linear_bem.errors import OutputUnusable
from runs.reporting.folder import read_folder
from runs.session.output_folder import MARK
from tests.launch import thirdbody


def test_a_folder_without_a_run_is_refused(tmp_path: Path) -> None:
    done = thirdbody("report", tmp_path)
    assert done.returncode == 2
    assert "holds no run and no study" in done.stderr


def test_a_damaged_file_of_a_run_is_named(tmp_path: Path) -> None:
    (tmp_path / MARK).write_text('{"identity": {"comm', encoding="utf-8")
    with pytest.raises(OutputUnusable, match=r"run\.json: is damaged.*--fresh"):
        read_folder(tmp_path)
    (tmp_path / MARK).write_text('{"identity": {"command": "solve"}, "state": "finished"}', encoding="utf-8")
    (tmp_path / "run.log").write_bytes(b"\xff")
    with pytest.raises(OutputUnusable, match=r"run\.log: cannot be read as text"):
        read_folder(tmp_path)
