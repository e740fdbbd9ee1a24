"""Expressions of the form language (UFL) that accept the numpy functions of indenters' heights."""

import operator
from typing import Any

import numpy as np
import ufl
from numpy.lib.mixins import NDArrayOperatorsMixin

FUNCTIONS = {
    np.add: operator.add,
    np.subtract: operator.sub,
    np.multiply: operator.mul,
    np.true_divide: operator.truediv,
    np.power: operator.pow,
    np.negative: operator.neg,
    np.absolute: abs,
    np.maximum: ufl.max_value,
    np.minimum: ufl.min_value,
    np.log: ufl.ln,
    **{getattr(np, name): getattr(ufl, name) for name in ("sqrt", "exp", "sin", "cos", "tan", "sinh", "cosh", "tanh")},
}
"""The form language's counterparts of the functions in `linear_bem.dual.SLOPES`."""


class Symbolic(NDArrayOperatorsMixin):
    """An ``expression`` of the form language, or an array, on which operators and functions of numpy act."""

    def __init__(self, expression: Any) -> None:
        self.expression = expression

    def __array_ufunc__(self, ufunc: np.ufunc, method: str, *inputs: Any, **kwargs: Any) -> Any:
        """Return the counterpart's expression; numpy raises TypeError for functions that have none."""
        if ufunc not in FUNCTIONS or method != "__call__" or kwargs:
            return NotImplemented
        operands = [v.expression if isinstance(v, Symbolic) else v for v in inputs]
        is_form = any(isinstance(v, ufl.core.expr.Expr) for v in operands)
        return Symbolic((FUNCTIONS[ufunc] if is_form else ufunc)(*operands))
