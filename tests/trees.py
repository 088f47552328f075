"""Short ways to write tree files in tests."""

from pathlib import Path

from sar_compiler.checks import check
from sar_compiler.nodes.spec import NodeSpec
from sar_compiler.tree.diagnostic import Severity
from sar_compiler.tree.forest import Forest
from sar_compiler.tree.xml import parse_xml


def class_of(spec: NodeSpec) -> type | None:
    """Return the class of a node; None if the installed py_trees is too old to have it."""
    try:
        return spec.cls
    except AttributeError:
        return None


def document(body: str, main: str = "Main") -> str:
    """Return a file with one tree, whose nodes start in line 3."""
    return f'<root BTCPP_format="4">\n<BehaviorTree ID="{main}">\n{body}\n</BehaviorTree>\n</root>\n'


def write(path: str | Path, *content: str, main: str = "") -> None:
    """Write a tree file with some lines of content; create missing folders."""
    named = f' main_tree_to_execute="{main}"' if main else ""
    Path(path).parent.mkdir(parents=True, exist_ok=True)
    Path(path).write_text(
        f'<root BTCPP_format="4"{named}>\n' + "\n".join(content) + "\n</root>\n", encoding="utf-8"
    )


def forest(body: str) -> Forest:
    """Read a file with one tree."""
    return forest_of(document(body))


def forest_of(text: str) -> Forest:
    """Read a file without included files from its text."""
    return Forest.from_file(parse_xml(text, "test.xml"))


def errors(forest, registry, palettes=()):
    """Return the errors of a file; `tests/checks` tests the warnings."""
    return [finding for finding in check(forest, registry, palettes) if finding.severity is Severity.ERROR]
