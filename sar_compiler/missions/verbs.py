"""The operator's verbs: what can be ordered of a mission under way, each by a service of its node."""

import sys
from collections.abc import Callable, Mapping, Sequence
from typing import Any, Literal, NamedTuple

from sar_compiler.errors import SarError

LONGEST = 200
"""How many characters a text of an order has at most."""


class VerbError(SarError):
    """An order is not one of the mission's, or is not complete."""


class VerbField(NamedTuple):
    """A value that comes with an order.

    Attributes:
        name: Its name. `x` and `y` together are a place on the map, in metres.
        label: What people read.
        kind: `text`; `number`; `choice`, of `choices`; `found`, the name of a landmark that was found.
        choices: For `choice`: pairs of a value and what people read.
        optional: Whether it may be left empty: a number is None then, anything else an empty text.
    """

    name: str
    label: str
    kind: Literal["text", "number", "choice", "found"] = "text"
    choices: Sequence[tuple[str, str]] = ()
    optional: bool = False


class Verb(NamedTuple):
    """Something that the operator can order.

    Attributes:
        name: The service's, on the mission's node: `pause` for `~/pause`. The answer has `success` and `message`.
        label: What is on its button.
        help: What it does, in a sentence.
        service_type: The service's type, `std_srvs/srv/Trigger` for one without values.
        fields: The values that come with it.
        confirm: What is asked before it is carried out; empty for what does no harm.
        fill: Fills the service's request with the values.
    """

    name: str
    label: str
    help: str
    service_type: str = "std_srvs/srv/Trigger"
    fields: Sequence[VerbField] = ()
    confirm: str = ""
    fill: Callable[[Any, Mapping[str, Any]], None] = lambda _request, _values: None

    def checked(self, values: Mapping[str, Any]) -> dict[str, Any]:
        """Return the values of an order.

        Raises:
            VerbError: If one is missing or wrong, or there are others.
        """
        if unknown := set(values) - {field.name for field in self.fields}:
            message = f"{self.name} takes no {min(unknown)!r:.60}"
            raise VerbError(message)
        return {field.name: self._checked(field, values.get(field.name)) for field in self.fields}

    def _checked(self, field: VerbField, value: Any) -> Any:
        if field.optional and value in ("", None):
            return None if field.kind == "number" else ""
        if field.kind == "number":
            # A whole number may be greater than any that is finite as a float.
            fits = type(value) in (int, float) and abs(value) <= sys.float_info.max
            wanted = "a number"
        else:
            fits = isinstance(value, str) and 0 < len(value) <= LONGEST and value.isprintable()
            wanted = f"a text of at most {LONGEST} characters, in one line"
            if field.kind == "choice":
                fits = fits and value in dict(field.choices)
                wanted = f"one of {', '.join(dict(field.choices))}"
        if not fits:
            message = f"{self.name}: {field.name} is {value!r:.60}, and must be {wanted}"
            raise VerbError(message)
        return float(value) if field.kind == "number" else value
