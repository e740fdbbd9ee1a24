"""Free memory, and the refusal of problems that need more, before any allocation."""

import ctypes
import os
from contextlib import suppress
from pathlib import Path

from linear_bem.errors import TooLarge

SHARE = 0.9
"""Share of the free memory that a problem may use."""


def free_memory() -> float:
    """Return the free memory [bytes]: on Linux, what is available without swapping, else the machine's total."""
    lines = Path("/proc/meminfo")
    if lines.exists():
        for line in lines.read_text(encoding="ascii").splitlines():
            if line.startswith("MemAvailable:"):
                return 1024.0 * float(line.split()[1])
    if "SC_PHYS_PAGES" in getattr(os, "sysconf_names", {}):
        return float(os.sysconf("SC_PHYS_PAGES")) * float(os.sysconf("SC_PAGE_SIZE"))
    return float("inf")


def require(needed: float, what: str, remedy: str) -> None:
    """Raise `TooLarge` if ``needed`` [bytes] is more than the free memory allows."""
    free = free_memory()
    if needed > SHARE * free:
        raise TooLarge(
            f"{what} needs about {needed / 1e9:.3g} GB of memory, and {free / 1e9:.3g} GB are free; {remedy}"
        )


def give_back() -> None:
    """Return freed memory to the system; the C library (glibc) would keep it for later allocations."""
    with suppress(OSError, AttributeError, TypeError):  # not glibc
        ctypes.CDLL(None).malloc_trim(0)
