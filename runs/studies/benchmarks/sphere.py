"""One sphere on a homogeneous half-space on the same grid: this project, tamaas and ASPHER."""

import importlib
import time
from collections.abc import Callable
from typing import Any

import numpy as np

from linear_bem import Layer, solve_height_field
from linear_bem.arrays import Array

RADIUS, CONTACT, SIDE = 1.0, 0.3, 1.0
"""Sphere's radius, Hertz's contact radius and the grid's side, with a contact modulus of 1."""
FORCE = 4.0 / 3.0 * CONTACT**3 / RADIUS
PEAK = 2.0 * CONTACT / (np.pi * RADIUS)
TOLERANCE = 1e-8


def heights(cells: int) -> Array:
    """Return the paraboloid's heights at the centres of ``cells`` x ``cells`` cells."""
    x = SIDE * ((np.arange(cells) + 0.5) / cells - 0.5)
    return np.asarray((x[:, None] ** 2 + x**2) / (2.0 * RADIUS))


def hertz(cells: int) -> Array:
    """Return Hertz's pressure at the centres of the cells."""
    return np.asarray(PEAK * np.sqrt(np.maximum(1.0 - 2.0 * RADIUS * heights(cells) / CONTACT**2, 0.0)))


def by_this_project(cells: int) -> Array:
    """Return the pressure of `linear_bem.solve_height_field`."""
    layer = Layer(1.0, 0.0, np.inf)
    return solve_height_field(
        layer, None, heights(cells), SIDE / cells, normal_force=FORCE, tolerance=TOLERANCE
    ).pressure


def by_aspher(cells: int) -> Array:
    """Return the pressure of ASPHER's nested solver (https://pypi.org/project/aspher)."""
    aspher = importlib.import_module("aspher")
    found = aspher.solve_nested(
        cells, heights(cells), FORCE / SIDE**2, domain_size=SIDE, E_star=1.0, tol=TOLERANCE, precision="double"
    )
    return np.asarray(found.pressure, dtype=float).reshape(cells, cells)


def by_tamaas(cells: int, *, periodic: bool) -> Array:
    """Return the pressure of tamaas' Polonsky-Keer solver (https://pypi.org/project/tamaas)."""
    tm: Any = importlib.import_module("tamaas")
    tm.set_log_level(tm.LogLevel.warning)
    tm.initialize(1)
    model = tm.ModelFactory.createModel(tm.model_type.basic_2d, [SIDE, SIDE], [cells, cells])
    model.E, model.nu = 1.0, 0.0
    if not periodic:
        tm.ModelFactory.registerNonPeriodic(model, "dcfft")
    kind = tm.PolonskyKeerRey.pressure
    solver = tm.PolonskyKeerRey(model, -heights(cells), TOLERANCE, primal_type=kind, constraint_type=kind)
    if not periodic:
        solver.setIntegralOperator("dcfft")
    solver.max_iter = 5000
    solver.solve(FORCE / SIDE**2)
    return np.array(model.traction, dtype=float).reshape(cells, cells)


CODES: dict[str, tuple[str, Callable[[int], Array]]] = {
    "this project": ("", by_this_project),
    "ASPHER": ("aspher", by_aspher),
    "tamaas": ("tamaas", lambda cells: by_tamaas(cells, periodic=False)),
    "tamaas, periodic": ("tamaas", lambda cells: by_tamaas(cells, periodic=True)),
}
"""Name, package and solver of every code."""


def measure(code: str, cells: int) -> dict[str, Any]:
    """Return time [s] and errors of one code on one grid; for a missing code, the remark says how to install it."""
    row = {"code": code, "cells": cells, "seconds": np.nan, "pressure_error": np.nan, "load_error": np.nan}
    package, solver = CODES[code]
    try:
        if package:
            importlib.import_module(package)
    except ImportError as error:
        return row | {"remark": f"not measured ({error}): pip install {package}"}
    begun = time.perf_counter()
    pressure = solver(cells)
    row["seconds"] = time.perf_counter() - begun
    exact = hertz(cells)
    row["pressure_error"] = float(np.linalg.norm(pressure - exact) / np.linalg.norm(exact))
    row["load_error"] = float(abs(np.sum(pressure) * (SIDE / cells) ** 2 / FORCE - 1.0))
    return row | {"remark": ""}
