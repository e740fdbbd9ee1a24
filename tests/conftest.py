from __future__ import annotations

import os
import signal

import pytest


def pytest_configure() -> None:
    """Give each process that shares the files its own cores.

    Ranks that wait for each other yield to any other process: two on a core beside a busy test take three times as
    long as alone, and four on two cores ten times.
    """
    worker, count = os.environ.get("PYTEST_XDIST_WORKER"), os.environ.get("PYTEST_XDIST_WORKER_COUNT")
    if worker and count and hasattr(os, "sched_setaffinity"):
        cores = sorted(os.sched_getaffinity(0))
        own = cores[int(worker.removeprefix("gw")) % len(cores) :: int(count)]
        os.sched_setaffinity(0, own)


def pytest_runtest_setup() -> None:
    """Give closed pipes back to Python: under PETSc, which an earlier test may have loaded, they end the process."""
    signal.signal(signal.SIGPIPE, signal.SIG_IGN)


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Put files with slow tests first: processes that share the files then end at about the same time."""
    long = {item.path for item in items if item.get_closest_marker("slow")}
    items.sort(key=lambda item: item.path not in long)
