"""Planned time and memory against measured ones."""

from __future__ import annotations

from dataclasses import replace

import pytest

from finite_strain.planning.cost import Mesh
from tests.runs.plan_calibration import CASES, planned
from tests.runs.plan_errors import judged, scene

MEASURED = {
    "one": (6150, 4.4, 374e6),
    "approach": (9750, 6.9, 487e6),
    "force": (9750, 8.1, 491e6),
    "mixed": (10821, 9.9, 539e6),
    "path": (10920, 15.4, 525e6),
    "unlike": (18840, 22.5, 747e6),
    "thick": (20163, 16.1, 832e6),
    "substrate": (12675, 9.4, 586e6),
    "ogden": (9750, 10.6, 489e6),
    "order 4": (32643, 35.6, 1804e6),
    "triangle": (38951, 58, 1548e6),
}
"""Unknowns, processor time [s] and memory [bytes] by the command of `tests.runs.plan_calibration`."""


@pytest.mark.parametrize("name", MEASURED)
def test_a_plan_estimates_what_was_measured(name: str) -> None:
    pytest.importorskip("gmsh")
    said, (unknowns, seconds, memory) = planned(name), MEASURED[name]
    assert said["unknowns"] == unknowns
    assert seconds / 1.5 < said["seconds"] < 1.5 * seconds
    assert memory / 1.3 < said["memory"] < 1.3 * memory


def test_every_case_of_the_calibration_can_be_planned() -> None:
    assert set(MEASURED) == set(CASES)
    assert all(planned(name)["seconds"] > 0.0 for name in CASES)


def test_more_steps_pairs_orders_and_unknowns_cost_more() -> None:
    mesh = Mesh(1e4, 3, 4, 2, 2, direct=True)
    for more in (
        {"unknowns": 2e4}, {"order": 4}, {"steps": 3}, {"pairs": 3}, {"mixed": True}, {"stretches": True}, {"free": 1},
        {"depth": 0.2},
    ):  # fmt: skip
        dearer = replace(mesh, **more)
        assert dearer.seconds > mesh.seconds
        assert dearer.memory_bytes(1) >= mesh.memory_bytes(1)
    iterative, saddle = (replace(mesh, direct=False, mixed=mixed) for mixed in (False, True))
    assert saddle.seconds > 3.0 * iterative.seconds
    assert saddle.memory_bytes(1) > 1.4 * iterative.memory_bytes(1)
    assert replace(mesh, order=2).seconds > mesh.seconds  # the path finder searches the contact's edge
    assert replace(mesh, pairs=0).memory_bytes(1) < mesh.memory_bytes(1) < mesh.memory_bytes(2)


def test_random_scenes_are_the_same_each_time_and_unlike_each_other() -> None:
    assert [scene(number) for number in range(9)] == [scene(number) for number in range(9)]
    assert len({str(scene(number)) for number in range(9)}) == 9


def test_expected_errors_are_judged_by_their_scatter_and_by_the_meshes_that_they_name() -> None:
    said = judged([(0.01, 0.01), (0.003, 0.05), (0.001, 0.0025), (0.1, 0.25)])  # beyond what is asked only the second
    assert said.startswith("4 scenes: reached over expected 2.50 in the median")
    assert "25% within a factor 2; another number of meshes for 25% of accuracies" in said
