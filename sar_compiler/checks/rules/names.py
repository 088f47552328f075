"""Names that do not tell nodes apart."""

from collections.abc import Iterator, Sequence

from sar_compiler.checks.rules.subject import Subject
from sar_compiler.nodes.bound import BoundNode
from sar_compiler.tree.diagnostic import Diagnostic, Severity


def check_names(subject: Subject) -> Iterator[Diagnostic]:
    """Yield nodes beside each other to which their author has given one name."""
    for tree in subject.trees if subject.sound and not subject.is_foreign else ():
        for bound in tree.parents:
            children = bound.children
            if len(children) > 1 and len({child.name for child in children}) < len(children):
                yield from _same(children)


def _same(children: Sequence[BoundNode]) -> Iterator[Diagnostic]:
    first: dict[str, BoundNode] = {}
    for child in children:
        if "name" not in child.element.attributes or child.subtree is not None:
            continue
        other = first.setdefault(child.name, child)
        if other is not child:
            message = (
                f"'{child.name}' is also the name of the node in line {other.element.line} beside it: drawings, logs "
                "and references cannot tell the two apart"
            )
            source, span = child.element.source, child.element.value_span("name")
            hint = "give each a name of its own"
            yield Diagnostic("same-name", message, source, span, hint=hint, severity=Severity.INFO)
