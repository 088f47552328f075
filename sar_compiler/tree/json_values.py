"""JSON as it is defined: numbers that are not finite are written, and read, as null."""

import functools
import json
import math
import re
from collections.abc import Mapping
from typing import Any

# A number that may be beyond what a float can be: an exponent, or digits, of such a length.
_HUGE = re.compile(r"[eE]\+?0*[1-9][0-9]{2}|[0-9]{300}")
# Made once: `json.loads` with an option makes one for each text, which takes longer than reading a short one.
_decode = json.JSONDecoder(parse_constant=lambda _: None).decode


def json_text(data: object, **options: Any) -> str:
    """Return a value as JSON; options are those of `json.JSONEncoder`, which is kept for each combination of them.

    Raises:
        TypeError: If it is no JSON value.
    """
    try:
        return _encoder(**options).encode(data)
    except ValueError:
        return _encoder(**options).encode(_finite(data))


@functools.cache
def _encoder(**options: Any) -> json.JSONEncoder:
    return json.JSONEncoder(allow_nan=False, **options)


def json_value(text: str) -> Any:
    """Return the value of a text of JSON, also of one with Python's `NaN` and `Infinity`.

    Raises:
        ValueError: If it is no JSON.
    """
    value = _decode(text)
    return _finite(value) if _HUGE.search(text) else value


def _finite(data: Any) -> Any:
    if isinstance(data, float):
        return data if math.isfinite(data) else None
    if isinstance(data, Mapping):
        return {key: _finite(value) for key, value in data.items()}
    return [_finite(value) for value in data] if isinstance(data, (list, tuple)) else data
