"""The house's rules: who may import whom, and what is imported when."""

import ast
import subprocess
import sys
from pathlib import Path

import pytest

from sar_compiler.nodes.registry import default_registry

PACKAGE = Path("sar_compiler")

# What each room may import of the others, besides `errors` and `resources`, which belong to nobody.
MAY_IMPORT = {
    "tree": set(),
    "runtime": set(),
    "nodes": {"tree", "runtime"},
    "compiler": {"tree", "runtime", "nodes"},
    "checks": {"tree", "runtime", "nodes", "compiler"},
    "missions": {"nodes", "runtime", "ros"},
    "ros": {"tree", "runtime", "nodes", "compiler", "checks", "missions"},
    "sim": {"tree", "runtime", "nodes", "compiler", "checks", "missions", "ros"},
    "views": {"tree", "runtime", "nodes", "compiler", "checks", "missions"},
    "testing": {"tree", "runtime", "nodes", "compiler", "checks", "views"},
}
COMMON = {"errors", "resources"}


def room_of(path):
    return path.relative_to(PACKAGE).parts[0].removesuffix(".py")


def imports_of(path):
    """Yield the modules that a file imports, wherever in it, with the line."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            yield from ((alias.name, node.lineno) for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module:
            yield from ((f"{node.module}.{alias.name}", node.lineno) for alias in node.names)


FILES = sorted(PACKAGE.rglob("*.py"))


@pytest.mark.parametrize("room", sorted(MAY_IMPORT))
def test_a_room_imports_only_from_the_rooms_below_it(room):
    allowed = MAY_IMPORT[room] | COMMON | {room}
    wrong = [
        f"{path}:{line} imports {module}"
        for path in FILES
        if room_of(path) == room
        for module, line in imports_of(path)
        if module.startswith("sar_compiler.") and module.split(".")[1] not in allowed
    ]
    assert wrong == []


def test_every_room_has_its_rule():
    assert {room_of(path) for path in FILES} - COMMON - {"__init__", "cli"} == set(MAY_IMPORT)


def test_ros_is_imported_only_at_the_edge():
    edge = ("missions", "ros", "sim", "cli/flight", "cli/sim")
    wrong = [
        f"{path}:{line} imports {module}"
        for path in FILES
        if not str(path.relative_to(PACKAGE)).startswith(edge)
        for module, line in imports_of(path)
        if module.split(".")[0].endswith(("rclpy", "_msgs", "_interfaces"))
    ]
    assert wrong == []


@pytest.mark.parametrize(
    "statement",
    [
        "import sar_compiler",
        "import sar_compiler.missions.search_and_rescue",
        "import sar_compiler.testing",
        "from sar_compiler.cli.compile import main; main(['validate', 'trees/search_and_rescue.xml'])",
        "from sar_compiler.cli.compile import main; main(['show', 'trees/search_and_rescue.xml'])",
        "from sar_compiler.cli.compile import main; main(['diff', *['trees/search_and_rescue.xml'] * 2])",
        "from sar_compiler.cli.compile import main; main(['nodes', '--format', 'groot2'])",
        "from sar_compiler.cli.compile import main; main(['convert', 'trees/search_and_rescue.xml', '--to', 'yaml'])",
        "from sar_compiler.cli.compile import main; main(['simulate', 'trees/search_and_rescue.xml'])",
        "from sar_compiler.cli.compile import main; main(['verify', 'trees/search_and_rescue.xml'])",
        "import sar_compiler.cli.run",
        "import sar_compiler.cli.sim",
    ],
)
def test_a_laptop_without_ros_can(statement):
    program = f"import sys; sys.modules['rclpy'] = None\n{statement}\n"
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


def test_no_code_of_a_file_is_ever_evaluated():
    wrong = [
        f"{path}:{node.lineno}"
        for path in FILES
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id in {"eval", "exec"}
    ]
    assert wrong == []


# Where a node is said what it is, or is written: nowhere else does a text of the code name one.
HOMES = (
    "nodes/language/",  # what each tag means
    "nodes/btcpp/",  # writes trees in BehaviorTree.CPP's nodes
    "missions/search_and_rescue/",  # registers its leaves
)
NAMED_ELSEWHERE = {
    "tree/model.py": {"SubTree"},  # a part of the file's grammar, before any node has a meaning
    "tree/matching.py": {"Condition"},  # the explicit form, <Condition ID="...">, not py_trees' decorator
    "nodes/spec.py": {"Condition"},  # the kind, likewise
    "cli/verify.py": {"ZonesRemaining", "NavigateToBase"},  # an example in its help
    "runtime/flat/stock_composites.py": {"ForEach"},  # the name of a class that an old py_trees does not have
    "runtime/flat/stock_decorators.py": {"ForEach"},
}


def texts_of(path):
    """Yield the texts of a file's code: no docstrings, no annotations, no parts of messages."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    passed = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Expr):
            passed.add(node.value)
        elif isinstance(node, ast.JoinedStr):
            passed.update(ast.walk(node))
        else:
            passed.update(each for name in ("annotation", "returns") if (each := getattr(node, name, None)))
    for node in ast.walk(tree):
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and node not in passed:
            yield node.value, node.lineno


def test_no_text_outside_its_home_names_a_node():
    tags = {*default_registry().by_tag(), "SubTree"}
    wrong = [
        f"{path}:{line} names <{text}>; ask its record (nodes.semantics)"
        for path in FILES
        if not (name := str(path.relative_to(PACKAGE))).startswith(HOMES)
        for text, line in texts_of(path)
        if text in tags - NAMED_ELSEWHERE.get(name, set())
    ]
    assert wrong == []
