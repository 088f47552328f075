"""Fixes of findings, and the application of these fixes to a text.

A finding's suggestion is a guess that the user normally reviews. A suggestion is safe, and is applied without asking, only
if the text cannot plausibly have another meaning. The functions in `SAFE` decide which suggestions are safe.
"""

import bisect
import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass

from sar_compiler.nodes.binding.attributes import CONDITIONS, ONESHOT, complete_key_braces
from sar_compiler.tree.diagnostic import Diagnostic, Form, Source
from sar_compiler.tree.display_text import escape_to_one_line, shorten
from sar_compiler.tree.guessing import is_typo
from sar_compiler.tree.model import Element, TreeFile, last_element_before
from sar_compiler.tree.yaml_writer import scalar

_COMMON = frozenset({"ID", "name", "memory", "BTCPP_format", "main_tree_to_execute", ONESHOT, *CONDITIONS})
"""Attributes that have the same meaning on every node."""
_TRUTHS = ("true", "false")
_AMBIGUOUS_OPERATORS = frozenset({"not", "=+", "=*", "=/", "=>"})
"""Operators of other languages for which the suggestion may be wrong.

For example, Python reads `not a == b` as `!(a == b)`.
"""
_BLOCK = re.compile(r"[|>][+\-0-9]*[ \t]*(#[^\r\n]*)?(\r\n|\r|\n)[\s]*$")

_MARKUP = re.compile(
    r"<!--.*?-->|<!\[CDATA\[.*?\]\]>|<\?.*?\?>"
    r"|<(?P<ends>/?)(?P<tag>[^\s/>]+)(?:\"[^\"]*\"|'[^']*'|[^\"'>])*?(?P<is_empty>/?)>",
    re.DOTALL,
)
_ATTRIBUTE = re.compile(r"[^\s=]+\s*=\s*(\"[^\"]*\"|'[^']*')")
_ENTRY = re.compile(r"""(?:'[^'\n]*'|"[^"\n]*"|[^\s'",:{}]+)\s*:\s*(?:"[^"\n]*"|'[^'\n]*')""")
"""A YAML attribute with a quoted value."""
_BEHIND_ENTRY = re.compile(r"\s*,\s*|")
_REST_OF_LINE = re.compile(r"[ \t]*(\r\n|\r|\n|$)")


def _differs_in_case(written: str, suggestion: str) -> bool:
    return written.lower() == suggestion.lower()


def _is_safe_name(written: str, suggestion: str) -> bool:
    """Return whether the fix corrects only letter case, or one typo in a common attribute."""
    return _differs_in_case(written, suggestion) or (suggestion in _COMMON and is_typo(written, suggestion))


def _is_safe_value(written: str, suggestion: str) -> bool:
    """Return whether the fix corrects only blanks, letter case, a missing brace, or a typo in `true` or `false`."""
    return (
        written.strip() == suggestion
        or _differs_in_case(written.strip(), suggestion)
        or complete_key_braces(written) == suggestion
        or (suggestion in _TRUTHS and is_typo(written, suggestion))
    )


def _is_safe_script(written: str, _suggestion: str) -> bool:
    """Return whether the replaced text is not an ambiguous operator of another language."""
    return written not in _AMBIGUOUS_OPERATORS


def _is_quoting(written: str, suggestion: str) -> bool:
    """Return whether the fix only adds the quotation marks that YAML requires around a key in braces."""
    return suggestion == f"'{written}'"


def _is_deletion(_written: str, suggestion: str) -> bool:
    """Return whether the fix deletes an output that has no key."""
    return not suggestion


def _accept_any(_written: str, _suggestion: str) -> bool:
    """Return True. Escaping a character is always safe."""
    return True


SAFE: Mapping[str, Callable[[str, str], bool]] = {
    "unknown-attribute": _is_safe_name,
    "wrong-value": _is_safe_value,
    "script-error": _is_safe_script,
    "btcpp-version": _is_safe_script,
    "wrong-shape": _is_quoting,
    "loose-xml": _accept_any,
    "ignored-attribute": _is_deletion,
}
"""For each finding code, the function that decides whether the suggestion may replace the text without asking.

Tags, tree IDs, keys and references are never fixed without asking, because a similar name may be another node.
"""


@dataclass(frozen=True)
class Fix:
    """The replacement of one piece of text.

    Attributes:
        finding: The finding that the replacement fixes.
        start: The offset of the first character to replace.
        end: The offset after the last character to replace.
        text: The replacement.
    """

    finding: Diagnostic
    start: int
    end: int
    text: str

    def describe(self) -> str:
        """Return a line that describes the fix and its location."""
        finding = self.finding
        source, span = finding.source, finding.span
        place = f"{source.path}:{span.line}:{span.column}"
        written, suggestion = (
            escape_to_one_line(shorten(each)) for each in (_text(finding), finding.suggestion or "deleted")
        )
        return f"{place}: fixed[{finding.code}]: {written} -> {suggestion}"


IsMeant = Callable[[Diagnostic], bool]
"""A function that decides whether to apply a finding's suggestion."""


def _text(finding: Diagnostic) -> str:
    start, end = finding.source.offsets(finding.span)
    return finding.source.text[start:end]


def is_safe(finding: Diagnostic) -> bool:
    """Return whether a finding has a suggestion that can be applied without asking the user."""
    decide = SAFE.get(finding.code)
    return (
        decide is not None and finding.suggestion is not None and decide(_text(finding), finding.suggestion)
    )


def fixes(
    source: Source, tree_file: TreeFile | None, findings: Iterable[Diagnostic], is_meant: IsMeant = is_safe
) -> list[Fix]:
    """Return the fixes for a file, ordered by position. They do not overlap.

    Args:
        source: The file.
        tree_file: The parsed file; None if it could not be parsed.
        findings: The findings; those about other files are ignored.
        is_meant: A function that decides whether to apply a suggestion; by default, only safe suggestions are applied.
    """
    found: list[Fix] = []
    for fix in each_fix(source, tree_file, findings, is_meant):
        if not found or found[-1].end <= fix.start:
            found.append(fix)
    return found


def each_fix(
    source: Source, tree_file: TreeFile | None, findings: Iterable[Diagnostic], is_meant: IsMeant = is_safe
) -> Iterator[Fix]:
    """Yield the fix of each finding; see `fixes` for the arguments.

    Fixes may overlap, so apply one fix at a time.
    """
    values = _AttributeValues(list(tree_file.root.iterate()) if tree_file is not None else [])
    for finding in sorted(findings, key=lambda each: (each.span.line, each.span.column)):
        if finding.source is source and finding.suggestion is not None and is_meant(finding):
            fix = _fix(finding, values)
            if fix is not None:
                yield fix


def apply_fixes(text: str, chosen: Iterable[Fix]) -> str:
    """Return a text with fixes applied. The fixes must be in order and not overlap."""
    parts, done = [], 0
    for fix in chosen:
        parts += [text[done : fix.start], fix.text]
        done = fix.end
    return "".join([*parts, text[done:]])


@dataclass(frozen=True)
class _AttributeSpan:
    """The offsets of an attribute in the text.

    Attributes:
        start: The offset of the first character of the value.
        end: The offset after the value.
        name: The offset of the attribute's name.
    """

    start: int
    end: int
    name: int


class _AttributeValues:
    def __init__(self, elements: Sequence[Element]) -> None:
        self._elements = elements
        # The spans of the last element are cached, because findings are requested in the order of the file.
        self._last: tuple[Element, Sequence[_AttributeSpan]] | None = None

    def span_around(self, finding: Diagnostic) -> _AttributeSpan | None:
        """Return the span of the attribute value that contains a finding; None if no value contains it."""
        element = last_element_before(self._elements, finding.span[:2])
        if element is None:
            return None
        start, end = finding.source.offsets(finding.span)
        values = self._spans_of(element)
        following = bisect.bisect_right(values, start, key=lambda each: each.start)
        value = values[following - 1] if following else None
        return value if value is not None and end <= value.end and value.start < value.end else None

    def _spans_of(self, element: Element) -> Sequence[_AttributeSpan]:
        if self._last is None or self._last[0] is not element:
            values = [_value_of(element, name) for name in element.attributes]
            self._last = element, sorted(values, key=lambda each: each.start)
        return self._last[1]


def _value_of(element: Element, attribute: str) -> _AttributeSpan:
    source, span, name = element.source, element.value_span(attribute), element.name_span(attribute)
    start, end = source.offsets(span)
    return _AttributeSpan(start, end, source.offset(name.line, name.column))


def _fix(finding: Diagnostic, values: _AttributeValues) -> Fix | None:
    """Return the fix that inserts a finding's suggestion, escaped if necessary; None without a suggestion."""
    start, end = finding.source.offsets(finding.span)
    text = finding.suggestion or ""
    if not text and finding.code == "ignored-attribute":
        return _attribute_removal(finding, start)
    value = values.span_around(finding) if finding.code != "loose-xml" else None
    if value is None and finding.code != "loose-xml" and finding.source.text.startswith("<", start):
        return _tag_fix(finding, start + 1, end)
    if value is None:  # a name, the whole text, or an unreadable value
        return Fix(finding, start, end, text)
    source = finding.source
    escapes = _escapes_in(source, value)
    if escapes is not None:
        return Fix(finding, start, end, "".join(escapes.get(each, each) for each in text))
    # A plain YAML scalar may need quotation marks after the fix.
    whole = source.text[value.start : start] + text + source.text[end : value.end]
    return None if "\n" in whole or "\r" in whole else Fix(finding, value.start, value.end, scalar(whole))


def _attribute_removal(finding: Diagnostic, start: int) -> Fix | None:
    """Return the fix that deletes an attribute.

    In XML, the fix also deletes the blanks before the attribute. In YAML, it also deletes the attribute's
    line or comma.
    """
    text = finding.source.text
    if finding.source.form is Form.XML:
        found = _ATTRIBUTE.match(text, start)
        return None if found is None else Fix(finding, len(text[:start].rstrip()), found.end(), "")
    start -= text[start - 1] in "'\""
    entry, before = _ENTRY.match(text, start), len(text[:start].rstrip())
    if entry is None:
        return None
    if text[before - 1] == ",":
        return Fix(finding, before - 1, entry.end(), "")
    if text[before - 1] == "{":
        behind = _BEHIND_ENTRY.match(text, entry.end())
        return Fix(finding, start, behind.end() if behind else entry.end(), "")
    rest = _REST_OF_LINE.match(text, entry.end())
    line = finding.source.offset(finding.span.line, 1)
    return None if rest is None else Fix(finding, line, rest.end(), "")


def _tag_fix(finding: Diagnostic, start: int, end: int) -> Fix:
    """Return the fix that renames an XML element in its start tag and end tag."""
    text, tag, depth = finding.source.text, finding.suggestion or "", 0
    for found in _MARKUP.finditer(text, start - 1):
        if found["tag"] is not None:
            depth += -1 if found["ends"] else 0 if found["is_empty"] else 1
            if depth == 0 and found["ends"]:
                return Fix(finding, start, found.end("tag"), f"{tag}{text[end : found.start('tag')]}{tag}")
            if depth == 0:
                break
    return Fix(finding, start, end, tag)


def _escapes_in(source: Source, value: _AttributeSpan) -> Mapping[str, str] | None:
    """Return the escape sequence for each special character of a value; None for a plain YAML scalar."""
    quote = source.text[value.start - 1]
    if source.spans.is_verbatim(value.start):
        return {}
    if source.form is Form.XML:
        return {"&": "&amp;", "<": "&lt;", quote: "&quot;" if quote == '"' else "&apos;"}
    if quote == "'":
        return {"'": "''"}
    if quote == '"':
        return {"\\": "\\\\", '"': '\\"'}
    return {} if _BLOCK.search(source.text[value.name : value.start]) else None
