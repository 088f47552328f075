"""Classes of which nothing can be made."""

from collections.abc import Iterator

from sar_compiler.checks.rules.check_context import CheckContext
from sar_compiler.nodes.spec import NodeSpec
from sar_compiler.tree.diagnostic import Diagnostic


def check_classes(context: CheckContext) -> Iterator[Diagnostic]:
    """Yield the first node of each class that is abstract, which only an attempt to make one would show."""
    abstract = {spec.tag: spec for spec in context.bound.specs if spec.absent_methods}
    for bound in (node for tree in context.bound.trees for node in tree.nodes) if abstract else ():
        spec = abstract.pop(bound.spec.tag, None)
        if spec is not None:
            message, hint = f"<{spec.tag}> cannot be made: {_missing_in(spec)}", "write it in the class"
            element = bound.element
            yield element.finding("constructor-failed", message, hint=hint)


def _missing_in(spec: NodeSpec) -> str:
    methods = " and ".join(f"{name}()" for name in spec.absent_methods)
    return f"its class {spec.maker_path.replace(':', '.')} has no {methods}"
