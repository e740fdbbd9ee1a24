"""What a rank prints reaches its launcher in whole lines, a block at a time."""

from __future__ import annotations

import json
import os
import threading
from collections.abc import Iterator
from pathlib import Path

import pytest

from runs.process.forwarding import BLOCK, WholeLines
from tests.launch import mpirun

DOCUMENT = json.dumps([{"number": n, "of": [n, n + 1]} for n in range(3000)], indent=1) + "\n"


class Reader:
    """A launcher that reads a pipe in blocks, slowly."""

    def __init__(self) -> None:
        self.entrance, self.stream = (os.fdopen(end, mode) for end, mode in zip(os.pipe(), ("rb", "wb"), strict=True))
        self.blocks: list[bytes] = []
        self.thread = threading.Thread(target=self._read)
        self.thread.start()

    def _read(self) -> None:
        while block := os.read(self.entrance.fileno(), BLOCK):
            self.blocks.append(block)


@pytest.fixture
def reader() -> Iterator[Reader]:
    reader = Reader()
    yield reader
    reader.stream.close()
    reader.thread.join()
    reader.entrance.close()


def read(reader: Reader) -> list[bytes]:
    reader.stream.close()
    reader.thread.join()
    return reader.blocks


def test_every_block_ends_a_line_and_nothing_is_lost(reader: Reader) -> None:
    stream = WholeLines(reader.stream.fileno())
    # as `print` and rich write: not always whole lines
    for start in range(0, len(DOCUMENT), 1000):
        stream.write(DOCUMENT[start : start + 1000])
    blocks = read(reader)
    assert b"".join(blocks).decode() == DOCUMENT
    assert len(blocks) > len(DOCUMENT) / BLOCK > 10
    assert all(block.endswith(b"\n") for block in blocks)


def test_a_line_without_end_waits_for_a_flush_and_one_longer_than_a_block_arrives_whole(reader: Reader) -> None:
    stream = WholeLines(reader.stream.fileno())
    stream.write("Δ" * BLOCK + "\nand then")
    stream.flush()
    assert b"".join(read(reader)).decode() == "Δ" * BLOCK + "\nand then"


def test_a_reader_that_does_not_read_is_not_waited_for_without_end(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("runs.process.forwarding.PATIENCE", 0.0)
    entrance, end = os.pipe()
    stream = WholeLines(end)
    stream.write("one\n")
    stream.write("two\n")
    assert os.read(entrance, BLOCK) == b"one\ntwo\n"
    os.close(entrance)
    os.close(end)
    stream.flush()  # nothing waits: nothing to write


def test_a_descriptor_that_was_turned_to_another_file_takes_text_as_before(tmp_path: Path) -> None:
    entrance, end = os.pipe()
    stream = WholeLines(end)
    with open(tmp_path / "file", "wb") as file:
        os.dup2(file.fileno(), end)  # as a console does when nobody reads any more
    stream.write("to the file\n")
    os.close(end)
    os.close(entrance)
    assert (tmp_path / "file").read_text(encoding="utf-8") == "to the file\n"


@pytest.mark.mpi
def test_a_long_document_arrives_whole_through_the_launcher() -> None:
    pytest.importorskip("mpi4py")
    code = (
        "import sys; from mpi4py import MPI; from runs.process import ranks\n"
        "from runs.process.forwarding import forward_whole_lines\n"
        "from tests.runs.test_forwarding import DOCUMENT\n"
        "if ranks.is_root():\n"
        "    assert ranks.launched(); forward_whole_lines(); sys.stdout.write(DOCUMENT)\n"
    )
    done = mpirun(2, "-c", code)
    assert done.returncode == 0, done.stderr
    assert done.stdout == DOCUMENT
