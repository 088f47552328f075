"""The difference between two tree files as text: one line for each change, with the places in both."""

from collections.abc import Iterable

from sar_compiler.tree.difference import Change, Difference
from sar_compiler.tree.model import TEXT_KEY, Element


def difference_as_text(differences: Iterable[Difference]) -> str:
    """Return one line for each difference; an empty text if there is none."""
    return "".join(f"{one.change.value:8} {_said(one)}  ({_places(one)})\n" for one in differences)


def _said(one: Difference) -> str:
    if one.change is Change.MOVED:
        place = "" if one.after == one.path else f"{one.path}: "
        return f"{place}{one.before} -> {one.after}"
    if one.change is not Change.CHANGED:
        with_it = f", with {one.inner} in it" if one.inner else ""
        return f"{one.path} <{_type(one)}>{with_it}"
    if not one.what:
        return f"{one.path}: <{one.before}> -> <{one.after}>"
    name = "description" if one.what == TEXT_KEY else one.what
    return f"{one.path}: {name} {_value(one.before)} -> {_value(one.after)}"


def _type(one: Difference) -> str:
    element = one.new or one.old
    return element.tag if element else ""


def _value(text: str | None) -> str:
    if text is None:
        return "not written"
    return '"' + text.replace("\\", "\\\\").replace("\n", "\\n").replace("\r", "\\r") + '"'


def _places(one: Difference) -> str:
    return ", ".join(f"{element.source.path}:{element.line}" for element in _elements(one))


def _elements(one: Difference) -> list[Element]:
    return [element for element in (one.old, one.new) if element is not None]
