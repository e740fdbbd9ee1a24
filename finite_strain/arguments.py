"""Checks the types of the arguments of `finite_strain.solve` before any work; messages name the argument."""

import inspect
from collections.abc import Mapping, Sequence
from numbers import Real
from pathlib import Path
from typing import Any

import numpy as np

from finite_strain.numerics import Numerics
from finite_strain.output.field_catalogue import FieldChoice
from linear_bem.errors import InvalidProblem
from linear_bem.problem import Problem

CALLED = ("started", "attempt", "newton", "step_done")
"""Methods of an observer."""


def _numbers(value: Any) -> bool:
    is_list = value.ndim == 1 if isinstance(value, np.ndarray) else isinstance(value, Sequence)
    return is_list and all(isinstance(v, Real) for v in value)


def _inspector(value: Any) -> bool:
    if value is None or not callable(value):
        return value is None
    try:
        inspect.signature(value).bind(None, None)
    except TypeError:
        return False
    except ValueError:  # a built-in function without a signature
        return True
    return True


RULES: dict[str, tuple[Any, str]] = {
    "problem": (lambda v: isinstance(v, Problem), "a linear_bem.Problem"),
    "accuracy": (lambda v: isinstance(v, Real), "a number between 0 and 1"),
    "folder": (lambda v: v is None or isinstance(v, str | Path), "the path of a folder"),
    "observer": (
        lambda v: v is None or set(CALLED) <= set(dir(v)),
        f"an object with the methods {', '.join(CALLED)} (finite_strain.Observer)",
    ),
    "fields": (
        lambda v: v is None or isinstance(v, FieldChoice),
        'a choice such as FieldChoice(("displacement", "gap"))',
    ),
    "seconds": (lambda v: v is None or isinstance(v, Real), "a number"),
    "unknowns": (lambda v: v is None or isinstance(v, Real), "a number"),
    "steps": (lambda v: v is None or _numbers(v), "fractions of the load such as (0.5, 1.0)"),
    "numerics": (lambda v: isinstance(v, Numerics), "Numerics such as Numerics(growth=2.0)"),
    "solver_options": (
        lambda v: v is None or (isinstance(v, Mapping) and all(isinstance(name, str) for name in v)),
        'PETSc options such as {"pc_type": "lu"}',
    ),
    "inspect": (_inspector, "a function of two arguments, a step and its functions"),
}
"""Per argument: the check of its type, and the words for a valid value."""


def check_arguments(**given: Any) -> None:
    """Raise `InvalidProblem` with a message per argument of a wrong type."""
    faults = [f"{name}: must be {RULES[name][1]}, got {v!r:.80}" for name, v in given.items() if not RULES[name][0](v)]
    if faults:
        raise InvalidProblem(*faults)
