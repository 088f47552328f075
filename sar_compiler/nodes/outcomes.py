"""The simulated outcomes of a tree's leaves, from the registry's declarations."""

import re
from collections.abc import Collection, Iterable, Mapping
from dataclasses import replace

from sar_compiler.runtime.outcomes import STATUSES, Outcome
from sar_compiler.runtime.script import parse
from sar_compiler.runtime.tokens import ScriptError

SELF = "self"
"""The placeholder for the leaf's own name."""
NOBODY = "nobody"
"""The text that replaces a referenced node's name if the tree file omits the optional reference."""
_PLACEHOLDER = r"\{(\w+)\}"
_FACT = r"([A-Za-z_]|\{\w+\})([A-Za-z0-9_]|\{\w+\})*"
_NO_WORD = r"[^A-Za-z0-9_]"


def outcomes_of(outcomes: Collection[str]) -> tuple[Outcome, ...]:
    """Return the outcomes of a leaf that declares only statuses, or that declares nothing."""
    known = outcomes or ("SUCCESS", "FAILURE", "RUNNING")
    return tuple(Outcome(status) for status in STATUSES if status in known)


def is_fact_name(text: str) -> bool:
    """Return whether a text is a valid fact name: a variable name of scripts, possibly with placeholders."""
    return re.fullmatch(_FACT, text) is not None


def placeholders(text: str) -> list[str]:
    """Return the names of the placeholders in a script or fact name."""
    return re.findall(_PLACEHOLDER, text)


def fill_outcome(outcome: Outcome, names: Mapping[str, str]) -> Outcome:
    """Return an outcome with its placeholders replaced by identifiers."""
    return replace(
        outcome, when=fill_placeholders(outcome.when, names), then=fill_placeholders(outcome.then, names)
    )


def fill_placeholders(text: str, names: Mapping[str, str]) -> str:
    """Replace the placeholders in a text by identifiers. Unknown placeholders stay unchanged."""
    return re.sub(_PLACEHOLDER, lambda match: names.get(match[1], match[0]), text)


def number_text(value: object) -> str:
    """Return the text that replaces an integer's placeholder.

    Negative numbers are in parentheses, because a `-` may precede the placeholder.
    """
    return f"({value})" if str(value).startswith("-") else str(value)


def find_script_error(
    outcome: Outcome, known: Iterable[str] = (SELF,), numbers: Iterable[str] = ()
) -> tuple[str, str, ScriptError] | None:
    """Find the first script of an outcome that cannot be parsed.

    The result contains the field (`when` or `then`), the text and the error.
    """
    # Each replacement is as long as its placeholder, so that locations in the error match those in the text.
    names = {name: f"x{name}x" for name in known}
    names |= {name: f"({'1' * len(name)})" for name in numbers}
    for part, text in (("when", outcome.when), ("then", outcome.then)):
        if text:
            try:
                parse(fill_placeholders(text, names))
            except ScriptError as error:
                return part, text, error
    return None


class Identifiers:
    """Generator of unique identifiers from node names."""

    def __init__(self) -> None:
        self._taken: set[str] = set()
        self._last: dict[str, int] = {}

    def make_unique(self, name: str) -> str:
        """Return an identifier for a node's name, with `_` in place of characters that are not allowed.

        If an earlier node has this identifier, a number is appended: `Drive`, `Drive_2`.
        """
        word = re.sub(_NO_WORD, "_", name)
        # The search begins at the last number, because a hundred thousand leaves may have the same name.
        number = self._last.get(word, 1)
        candidate = f"{word}_{number}" if number > 1 else word
        while candidate in self._taken:
            number += 1
            candidate = f"{word}_{number}"
        self._taken.add(candidate)
        self._last[word] = number
        return candidate
