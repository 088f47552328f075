"""Comments that suppress findings, such as `<!-- sar: allow code: the reason -->`, or `# sar: allow code` in YAML.

A comment applies to the tag and attributes of the next element, or of the element on the same line. It does not apply
to the element's children.
"""

import re
from collections.abc import Iterable, Iterator

from sar_compiler.tree.diagnostic import Diagnostic, Form, Severity, Span
from sar_compiler.tree.forest import Forest
from sar_compiler.tree.guessing import Guesses
from sar_compiler.tree.model import Comment, Element, TreeFile, last_element_before

_MARK, _UNNEEDED = "sar:", "unneeded-allow"
_ALLOW = r"sar:\s*allow\s+([^:]*[^:\s])\s*(?::.*)?"
_PLACES = {
    Form.XML: r"(?m:(?:<!--|^)[ \t]*(sar:[^\r\n]*?)[ \t]*(?=-->|\r|\n))",
    Form.YAML: r"#[ \t]*(sar:[^\r\n]*)",
}
_FORM = "sar: allow some-code, another-code: the reason"


class _Suppression:
    """One suppression comment.

    Attributes:
        line: The text of the comment.
        element: The element to which the comment applies; None if no element follows.
        span: The location of the comment.
        tree_file: The file that contains the comment.
        used: The codes of the findings that the comment has suppressed.
    """

    def __init__(self, line: str, element: Element | None, span: Span, tree_file: TreeFile) -> None:
        self.line = line
        self.element = element
        self.span = span
        self.tree_file = tree_file
        self.used: set[str] = set()

    @property
    def codes(self) -> list[str]:
        """The codes that the comment names; empty if the comment is malformed."""
        match = re.fullmatch(_ALLOW, self.line)
        return [code.strip() for code in match[1].split(",")] if match else []


def remove_suppressed(forest: Forest, findings: Iterable[Diagnostic]) -> list[Diagnostic]:
    """Return the findings that no comment suppresses, and the findings about the comments themselves."""
    kept, guesses = list(findings), Guesses()
    whole = all(finding.severity is not Severity.ERROR for finding in kept)
    for number, tree_file in enumerate((*forest.files, *forest.others)):
        if _MARK not in tree_file.source.text:
            continue
        suppressions = list(_suppressions(tree_file))
        kept = _suppress(tree_file, suppressions, kept)
        if number < len(forest.files):
            # If there are errors, some rules do not run, and a comment may be needed for their findings.
            wrong = [
                each for one in suppressions for each in _check_suppression(one, guesses, unneeded=whole)
            ]
            unneeded = any(each.code == _UNNEEDED for each in wrong)
            if unneeded and any(map(forest.is_used_elsewhere, forest.trees)):
                # A check of another file that uses the tree may need the comment.
                wrong = [each for each in wrong if each.code != _UNNEEDED]
            kept += wrong
    return kept


def _suppress(
    tree_file: TreeFile, suppressions: list[_Suppression], findings: list[Diagnostic]
) -> list[Diagnostic]:
    by_element: dict[int, list[_Suppression]] = {}
    for suppression in suppressions:
        by_element.setdefault(id(suppression.element), []).append(suppression)
    elements = list(tree_file.root.iterate())
    kept = []
    for finding in findings:
        silencing = []
        if finding.source is tree_file.source and finding.severity is not Severity.ERROR:
            element = last_element_before(elements, finding.span[:2])
            about = by_element.get(id(element), []) if element is not None else []
            silencing = [each for each in about if finding.code in each.codes]
        for suppression in silencing:
            suppression.used.add(finding.code)
        if not silencing:
            kept.append(finding)
    return kept


def _suppressions(tree_file: TreeFile) -> Iterator[_Suppression]:
    """Yield the suppression comments of a file, in the order of the file."""
    source = tree_file.source
    pattern = re.compile(_PLACES[source.form])
    offset = 0
    for element, comment, start in _comments(tree_file):
        offset = max(offset, start)
        for line in comment.text.split("\n"):
            match = pattern.search(source.text, offset) if line.startswith(_MARK) else None
            if match is not None:
                offset = match.end()
                yield _Suppression(line, element, source.span(*match.span(1)), tree_file)


def _comments(tree_file: TreeFile) -> Iterator[tuple[Element | None, Comment, int]]:
    """Yield each comment, the element to which it applies, and a lower bound of its offset in the file."""
    for comment in tree_file.comments:
        if comment.index == 0:
            yield tree_file.root, comment, 0
    yield from _comments_in(tree_file.root)
    for comment in tree_file.comments:
        if comment.index > 0:
            yield None, comment, 0


def _comments_in(element: Element) -> Iterator[tuple[Element | None, Comment, int]]:
    start = element.offset
    for comment in element.comments:
        if comment.trailing or comment.attribute is not None:
            yield element, comment, start
    waiting: list[Comment] = []
    for each in element.content():
        if isinstance(each, Comment):
            waiting.append(each)
        else:
            yield from ((each, comment, start) for comment in waiting)
            waiting = []
            yield from _comments_in(each)
    yield from ((None, comment, start) for comment in waiting)


def _check_suppression(
    suppression: _Suppression, guesses: Guesses, *, unneeded: bool
) -> Iterator[Diagnostic]:
    from sar_compiler.tree.kinds import ERRORS, KINDS

    codes, source = suppression.codes, suppression.tree_file.source
    if not codes:
        message = f"'{suppression.line}' is not a valid suppression comment"
        yield Diagnostic("wrong-allow", message, source, suppression.span, hint=f"write '{_FORM}'")
        return
    for code in codes:
        span = _span_of(code, suppression)
        if code not in KINDS:
            near = guesses.nearest(code, [each for each in KINDS if each not in ERRORS])
            yield Diagnostic("wrong-allow", f"unknown kind of finding '{code}'", source, span, near)
        elif code in ERRORS:
            message = f"'{code}' is an error, and errors cannot be suppressed"
            yield Diagnostic(
                "wrong-allow", message, source, span, hint="fix the error and delete the comment"
            )
        elif unneeded and code not in suppression.used:
            element = suppression.element
            about = "no element follows it" if element is None else f"<{element.tag}> has no such finding"
            message = f"the comment does not suppress any '{code}' finding: {about}"
            yield Diagnostic("unneeded-allow", message, source, span, hint="delete the code or the comment")


def _span_of(code: str, suppression: _Suppression) -> Span:
    """Return the location of a code in a comment; if the code is not found, the location of the comment."""
    source, span = suppression.tree_file.source, suppression.span
    start, end = source.offsets(span)
    match = re.search(rf"(?<![\w-]){re.escape(code)}(?![\w-])", source.text[start:end]) if code else None
    return source.span(start + match.start(), start + match.end()) if match is not None else span
