"""The cache of compiled forms, which runs share: its folder, lock and compiler options."""

import fcntl
import logging
import math
import os
import re
import threading
import time
import warnings
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from functools import lru_cache
from importlib import machinery
from importlib.util import spec_from_file_location
from pathlib import Path
from typing import Any

from mpi4py import MPI

from linear_bem.errors import OutputUnusable

COMPILER_SECONDS, _NOTED_AFTER = 600, 2.0
"""How long the compiler waits for a form that another run compiles, and how long it works without a message [s]."""
_COMPILING = "compiling finite elements for this kind of scene, once: it may take minutes, and later runs reuse them"
_FLAGS = [
    "-O2", "-g0", "-ftree-vectorize", "-fno-math-errno", "-fno-trapping-math", "-fno-signed-zeros",
    "-fassociative-math",
]  # fmt: skip
_WIDE_FLAGS = ["-mavx2", "-mfma"]
"""Compiler flags of forms, and those where every rank's processor has these instructions: sums over quadrature points
are vectorised, and NaN and infinity keep their meaning. With -O2 alone matrices of order 4 take 1.5 times as long,
vectors and scalars 2.3 times. The names of compiled forms in the cache depend on the flags."""


@contextmanager
def compiler_options(comm: MPI.Comm) -> Iterator[dict[str, Any]]:
    """Yield the compiler's options (collective).

    Runs share the cache and may compile at the same time. A source without its ``.cached`` file, for which the compiler
    would wait, was left by a killed run if no other run compiles now, or if it is older than this waiting time.
    """
    cache = Path(os.environ.get("XDG_CACHE_HOME", Path.home() / ".cache")) / "thirdbody" / "forms"
    failure = None
    with ExitStack() as stack, warnings.catch_warnings():
        # a hexahedron of order 4 needs more quadrature points than the compiler's warning threshold
        warnings.filterwarnings("ignore", "Number of integration points per cell", UserWarning)
        if comm.rank == 0:
            try:
                cache.mkdir(parents=True, exist_ok=True)
                lock = stack.enter_context((cache / "lock").open("w"))
                oldest = time.time() - COMPILER_SECONDS
                with suppress(BlockingIOError):
                    fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
                    oldest = math.inf
                for source in _unfinished(cache, cache.stat().st_mtime_ns):
                    with suppress(FileNotFoundError):  # another run may remove it, too
                        if source.stat().st_mtime < oldest:
                            source.unlink()
                fcntl.flock(lock, fcntl.LOCK_SH)
            except OSError as error:
                failure = f"compiled forms cannot be kept in {cache}: {error}; set XDG_CACHE_HOME to a writable folder"
        failure = comm.bcast(failure, root=0)
        if failure:
            raise OutputUnusable(failure)
        flags = _FLAGS + (_WIDE_FLAGS if comm.allreduce(_has_wide_registers(), op=MPI.LAND) else [])
        options = {"timeout": COMPILER_SECONDS, "cache_dir": str(cache), "cffi_extra_compile_args": flags}
        stack.callback(vars(machinery).update, FileFinder=machinery.FileFinder)
        vars(machinery).update(FileFinder=FileFinder)
        # forms in the cache take no time
        slow = threading.Timer(_NOTED_AFTER, _announce)
        if comm.rank == 0:
            slow.start()
            stack.callback(slow.cancel)
        yield options


class FileFinder(machinery.FileFinder):
    """Finds a compiled form by its name: the compiler makes a finder for each form, which would list the folder.

    Other modules are found as usual. Python registers finders by the names of their classes: it stays ``FileFinder``.
    """

    def find_spec(self, fullname: str, target: Any = None) -> machinery.ModuleSpec | None:
        """Return the module of this name, None if there is none."""
        if not fullname.startswith("libffcx_"):
            return super().find_spec(fullname, target)
        files = (Path(self.path, fullname + suffix) for suffix in machinery.EXTENSION_SUFFIXES)
        return next((spec_from_file_location(fullname, file) for file in files if file.is_file()), None)


@lru_cache(maxsize=1)
def _announce() -> None:
    logging.getLogger("finite_strain").info(_COMPILING)


@lru_cache(maxsize=1)
def _has_wide_registers() -> bool:
    """Return whether this machine's processor has AVX2 and fused multiply-add; False where it does not say so."""
    with suppress(OSError):
        flags = re.search(r"^flags\s*:(.*)$", Path("/proc/cpuinfo").read_text(encoding="utf-8"), re.MULTILINE)
        return flags is not None and {"avx2", "fma"} <= set(flags[1].split())
    return False


@lru_cache(maxsize=1)
def _unfinished(cache: Path, changed: int) -> list[Path]:
    """Return the sources without a ``.cached`` file in a folder last ``changed`` at this time [ns].

    There may be thousands of forms: listing them for every form would take a fifth of a small run.
    """
    there = set(os.listdir(cache))
    return [cache / name for name in there if name.endswith(".c") and f"{name}.cached" not in there]
