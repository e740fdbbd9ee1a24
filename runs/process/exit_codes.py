"""The end of a command: exit code and one clear message, on one rank or on many."""

import errno
import io
import os
import signal
import sys
import time
import traceback
from collections.abc import Callable
from typing import NoReturn

from linear_bem.errors import InvalidProblem, OutputUnusable, ThirdBodyError, UnsupportedProblem
from runs.process import ranks, signals

BAD_INPUT = (InvalidProblem, UnsupportedProblem, OutputUnusable)


def run_to_end(task: Callable[[], int | None]) -> NoReturn:
    """Run ``task`` and exit: 0 or the code that it returns, 1 for a failure, 2 for bad input, 130 when interrupted.

    Every rank runs this, and rank 0 prints. Ranks that never joined MPI end with 0, so that the launcher
    does not kill rank 0, whose exit code is that of the job.
    """
    signals.listen()
    words = ""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="replace")  # "?" where the encoding of the terminal or pipe lacks "±"
    try:
        code = task() or 0
        sys.stdout.flush()
    except BaseException as error:
        code, words = _verdict(error)
    if words and ranks.is_root():
        print(words, file=sys.stderr, flush=True)
    if code:
        ranks.end_together(code, last_words=words, patience=1.0 if signals.received() else ranks.PATIENCE)
    if not ranks.joined() and not ranks.is_root():
        # rank 0 may be failing: Open MPI reports that after 1 s if another rank still runs, otherwise after 2 s
        signal.signal(signal.SIGTERM, signal.SIG_DFL)
        time.sleep(3.0 if code else 0.5)
        code = 0
    if signals.received():
        os._exit(code)  # interrupted libraries may hang in their clean-up
    sys.exit(code)


def _verdict(error: BaseException) -> tuple[int, str]:
    if signals.received() or isinstance(error, KeyboardInterrupt):
        code = 128 + (signals.received() or signal.SIGINT)
        kept = "; finished steps are saved, and the same command continues from there" if signals.resumable else ""
        return code, f"thirdbody: stopped{kept}"
    if isinstance(error, SystemExit):
        return (error.code if isinstance(error.code, int) else 1), ""
    if isinstance(error, ThirdBodyError):
        return (2 if isinstance(error, BAD_INPUT) else 1), f"thirdbody: error: {error}"
    if isinstance(error, OSError) and error.filename is None and error.errno in (errno.ENOSPC, errno.EPIPE, errno.EIO):
        sys.stdout = open(os.devnull, "w", encoding="utf-8")  # noqa: SIM115  (what is buffered cannot be written at exit)
        return 2, f"thirdbody: error: standard output: cannot be written: {error.strerror}; write it elsewhere"
    trace = "".join(traceback.format_exception(error))
    rank = ranks.rank_and_size()[0]
    return 1, f"{trace}thirdbody: unexpected failure on rank {rank}, please report it with the lines above"
