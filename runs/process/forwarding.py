"""Standard output through an MPI launcher's pipe: whole lines, in blocks no larger than the launcher reads at once.

Open MPI 5 reads its ranks' output in blocks of 4096 bytes and may lose the text after the last end of line in a block
(seen with 5.0.7: about 20 bytes of a document of 20 kB were lost, in every second run). A block that ends with
a line and is read before the next one is written cannot be cut.
"""

import fcntl
import io
import os
import stat
import sys
import termios
import time

BLOCK = 4096
"""Largest number of bytes written at once; the kernel does not split blocks of this size."""
PATIENCE = 2.0
"""Longest wait [s] until a block is read; a launcher that takes longer is assumed not to read."""


class WholeLines(io.TextIOBase):
    """A text stream that writes whole lines to a pipe's file descriptor, at most `BLOCK` bytes at once."""

    encoding = "utf-8"

    def __init__(self, descriptor: int) -> None:
        self._descriptor = descriptor
        self._waiting = ""
        self._patience = PATIENCE

    def fileno(self) -> int:
        """Return the pipe's file descriptor."""
        return self._descriptor

    def write(self, text: str) -> int:
        """Write complete lines to the pipe immediately; keep an incomplete line until it ends or `flush`."""
        *lines, self._waiting = (self._waiting + text).split("\n")
        piece = b""
        for line in lines:
            encoded = f"{line}\n".encode()
            if piece and len(piece) + len(encoded) > BLOCK:
                self._send(piece)
                piece = b""
            piece += encoded
        self._send(piece)
        return len(text)

    def flush(self) -> None:
        """Write the incomplete line."""
        text, self._waiting = self._waiting, ""
        self._send(text.encode())

    def _send(self, piece: bytes) -> None:
        while piece:
            piece = piece[os.write(self._descriptor, piece) :]
        deadline = time.monotonic() + self._patience
        while _unread(self._descriptor):
            if time.monotonic() > deadline:
                self._patience = 0.0  # not a launcher that reads at once
                return
            time.sleep(2e-4)


def _unread(descriptor: int) -> int:
    """Return the number of unread bytes in a pipe; 0 if the descriptor is no longer a pipe."""
    try:
        return int.from_bytes(fcntl.ioctl(descriptor, termios.FIONREAD, bytes(4)), sys.byteorder)
    except OSError:
        return 0


def forward_whole_lines() -> None:
    """Write standard output in whole lines if a launcher reads it through a pipe."""
    try:
        descriptor = sys.stdout.fileno()
        pipe = stat.S_ISFIFO(os.fstat(descriptor).st_mode)
    except (AttributeError, OSError, ValueError):  # closed, or not a file
        return
    if pipe:
        sys.stdout.flush()
        sys.stdout = WholeLines(descriptor)
