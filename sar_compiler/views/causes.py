"""One cause, one finding: what people are told of findings that come of the same."""

from collections import Counter
from collections.abc import Callable, Hashable, Iterable, Sequence
from dataclasses import replace

from sar_compiler.tree.diagnostic import Cause, Diagnostic

FEW = 3
"""The most places of a cause in one file, and the most messages of one, that are told by themselves."""

_NAMED = 8


def by_cause(findings: Iterable[Diagnostic]) -> list[Diagnostic]:
    """Return one finding for each cause, at its first place, with how many more there are.

    Up to `FEW` places in one file are findings of their own; so are the messages of a cause that has up to `FEW`.
    """
    causes = _groups(findings, lambda each: (each.cause, each.severity))
    return [told for group in causes for told in _of_one_cause(group)]


def _groups(findings: Iterable[Diagnostic], key: Callable[[Diagnostic], Hashable]) -> list[list[Diagnostic]]:
    """Return findings in groups of equal keys, in the order of the first ones."""
    groups: dict[Hashable, list[Diagnostic]] = {}
    for each in findings:
        groups.setdefault(key(each), []).append(each)
    return list(groups.values())


def _of_one_cause(group: Sequence[Diagnostic]) -> list[Diagnostic]:
    by_message = _groups(group, lambda each: each.message)
    cause = group[0].common_cause
    if cause is not None and len(by_message) > FEW:
        return [replace(group[0], message=_listed(cause, group), suggestion=None)]
    return [told for places in by_message for told in _of_one_message(places)]


def _of_one_message(places: Sequence[Diagnostic]) -> Sequence[Diagnostic]:
    files = {each.source.path for each in places}
    if len(places) <= FEW and len(files) == 1:
        return places
    first, others = places[0], places[1:]
    near = ", ".join(f"{each.source.path}:{each.span.line}" for each in others[:FEW])
    more = ", ..." if others[FEW:] else ""
    where = f"and in {_count(len(others), 'more place')}: {near}{more}"
    return [replace(first, message=f"{first.message}; {where}")]


def _listed(cause: Cause, group: Iterable[Diagnostic]) -> str:
    """Return the sentence that lists what a cause is about, the most frequent first."""
    counts = Counter(each.common_cause.subject for each in group if each.common_cause)
    named = ", ".join(f"'{subject}' ({number:,})" for subject, number in counts.most_common(_NAMED))
    others = f" and {len(counts) - _NAMED:,} more" if len(counts) > _NAMED else ""
    return f"{cause.text}: {named}{others}, in {_count(counts.total(), 'place')}"


def _count(number: int, what: str) -> str:
    return f"{number:,} {what}{'' if number == 1 else 's'}"
