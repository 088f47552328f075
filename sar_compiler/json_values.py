"""Reading and writing of standard JSON. Numbers that are not finite become null."""

import functools
import json
import math
from collections.abc import Mapping
from typing import Any


def _float(text: str) -> float | None:
    value = float(text)
    return value if math.isfinite(value) else None


# Created once: with an option, `json.loads` creates a decoder for each text, which takes longer than decoding a short text.
_decoder = json.JSONDecoder(parse_constant=lambda _: None, parse_float=_float)


def json_text(data: object, **options: Any) -> str:
    """Convert a value to JSON text; *options* are arguments of `json.JSONEncoder`.

    Raises:
        TypeError: If the value is not a JSON value.
    """
    try:
        return _encoder(**options).encode(data)
    except ValueError:
        return _encoder(**options).encode(_finite(data))


@functools.cache
def _encoder(**options: Any) -> json.JSONEncoder:
    return json.JSONEncoder(allow_nan=False, **options)


def json_value(text: str) -> Any:
    """Parse a JSON text, which may contain Python's `NaN` and `Infinity`.

    Raises:
        ValueError: If the text is not JSON.
    """
    # `scan_once` is faster than `decode`, but does not skip blanks around the value. Most texts have no such blanks.
    try:
        value, end = _decoder.scan_once(text, 0)  # type: ignore[attr-defined]
    except StopIteration:
        end = -1
    return value if end == len(text) else _decoder.decode(text)


def json_data(value: object) -> Any:
    """Convert a value to JSON values: iterables become lists, and objects without a JSON counterpart become strings."""
    return json_value(json_text(value, default=_to_json))


def _to_json(value: Any) -> Any:
    return [*value] if hasattr(value, "__iter__") else str(value)


def _finite(data: Any) -> Any:
    if isinstance(data, float):
        return data if math.isfinite(data) else None
    if isinstance(data, Mapping):
        return {key: _finite(value) for key, value in data.items()}
    return [_finite(value) for value in data] if isinstance(data, (list, tuple)) else data
