"""Memory and speed of this machine."""

import os
import time
from functools import cache
from pathlib import Path

LIMITS = (Path("/sys/fs/cgroup/memory.max"), Path("/sys/fs/cgroup/memory/memory.limit_in_bytes"))
"""Files that hold a container's memory limit: control groups of version 2 and 1."""
POINTS, TIMES, MEASURED = 10, 20, 3.3e-3
"""Benchmark of `slowness`: points along each side, repetitions, and time [s] on the reference machine of the plans'
constants. On a machine where it took 7.3e-3 s, six runs took 1.95 to 2.44 times as long as on the reference machine."""


def memory_bytes() -> float:
    """Return the memory that this process may use [bytes]: the machine's, or the container's if that is less."""
    sizes = [float(os.sysconf("SC_PAGE_SIZE")) * os.sysconf("SC_PHYS_PAGES")]
    for path in LIMITS:
        try:
            sizes.append(float(path.read_text(encoding="ascii")))
        except (OSError, ValueError):  # absent, or "max"
            continue
    return min(sizes)


def own_memory(key: str) -> float:
    """Return a memory [bytes] of this process from Linux's /proc: VmRSS, or VmHWM, the largest; NaN without /proc."""
    file = Path("/proc/self/status")
    lines = file.read_text(encoding="ascii").splitlines() if file.exists() else []
    found = [line.split() for line in lines if line.startswith(f"{key}:")]
    return 1024.0 * float(found[0][1]) if found else float("nan")


@cache
def slowness() -> float:
    """Return the time of computations on this machine over that on the reference machine of the plans' constants.

    Benchmark: factorisation of Laplace's equation on `POINTS` cubed points, the quickest of many (0.1 to 0.2 s in all).
    """
    from scipy.sparse import diags, identity, kron  # noqa: PLC0415  (only where a plan is made)
    from scipy.sparse.linalg import splu  # noqa: PLC0415

    line, one = diags([-1.0, 2.0, -1.0], [-1, 0, 1], shape=(POINTS, POINTS)), identity(POINTS)
    matrix = (kron(kron(line, one), one) + kron(kron(one, line), one) + kron(kron(one, one), line)).tocsc()

    def seconds() -> float:
        begun = time.thread_time()
        splu(matrix)
        return time.thread_time() - begun

    return min(seconds() for _ in range(TIMES)) / MEASURED
