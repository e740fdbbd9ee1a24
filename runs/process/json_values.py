"""Results as plain JSON: numpy values become Python values, and non-finite numbers become null."""

import json
import math
from collections.abc import Mapping
from typing import Any

Document = dict[str, Any]
"""A JSON object as saved and printed; numbers in SI units."""


def plain(value: Any, infinity: str | None = None) -> Any:
    """Return ``value`` as JSON values; nan becomes None, and so does infinity unless the word ``infinity`` is given."""
    if isinstance(value, Mapping):
        return {str(key): plain(item, infinity) for key, item in value.items()}
    if isinstance(value, list | tuple | set | frozenset):
        return [plain(item, infinity) for item in value]
    if isinstance(value, float):
        if math.isinf(value) and infinity is not None:
            return infinity if value > 0.0 else f"-{infinity}"
        return float(value) if math.isfinite(value) else None
    if hasattr(value, "tolist"):
        return plain(value.tolist(), infinity)
    return value if isinstance(value, bool | int | str) or value is None else str(value)


def as_given(scene: Mapping[str, Any]) -> Document:
    """Return the tables of a scene as JSON values that the scene reader accepts."""
    return dict(plain(scene, infinity="inf"))


def to_json(document: Any) -> str:
    """Return strict JSON: no nan, no infinity."""
    return json.dumps(plain(document), indent=1, allow_nan=False, ensure_ascii=False) + "\n"
