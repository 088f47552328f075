"""Short ways to write tree files in tests."""

from sar_compiler.tree.model import TreeFile
from sar_compiler.tree.xml import parse_xml


def document(body: str, main: str = "Main") -> str:
    """Return a file with one tree; the tree's own lines begin in line 3."""
    return f'<root BTCPP_format="4">\n<BehaviorTree ID="{main}">\n{body}\n</BehaviorTree>\n</root>\n'


def tree_file(body: str) -> TreeFile:
    """Read a file with one tree."""
    return parse_xml(document(body), "test.xml")
