"""What is public: its names are there, lazily and typed, and everybody outside uses nothing else."""

import ast
import re
import subprocess
import sys
from pathlib import Path

import pytest

import sar_compiler
from tests.docs.markdown import PAGES, blocks

FINDINGS = sorted(Path("docs/findings").glob("*.md"))
PUBLIC = {"sar_compiler", "sar_compiler.testing"}
ROS = {"TreeRunner", "serve", "readable_ros_errors"}


def in_python(program):
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return done.stdout.strip()


@pytest.mark.parametrize("name", sorted(set(sar_compiler.__all__) - ROS))
def test_a_public_name_is_there_without_ros(name):
    assert (
        in_python(f"import sys; sys.modules['rclpy'] = None\nimport sar_compiler; sar_compiler.{name}") == ""
    )


@pytest.mark.ros
@pytest.mark.parametrize("name", sorted(ROS))
def test_a_public_name_for_ros_is_there(name):
    assert callable(getattr(sar_compiler, name))


def test_to_import_the_package_imports_no_library():
    libraries = ("py_trees", "lxml", "rclpy", "yaml")
    assert in_python(f"import sys, sar_compiler; print([x for x in {libraries} if x in sys.modules])") == "[]"


def test_a_name_that_is_not_public_is_no_attribute():
    with pytest.raises(AttributeError, match="module 'sar_compiler' has no attribute 'Regsitry'"):
        sar_compiler.Regsitry  # noqa: B018


def test_everything_public_is_listed_for_completion():
    assert set(sar_compiler.__all__) <= set(dir(sar_compiler))


def test_what_type_checkers_see_is_what_there_is():
    """The names are said three times: for type checkers, for `import *`, and for the look-up."""
    module = ast.parse(Path("sar_compiler/__init__.py").read_text(encoding="utf-8"))
    (typed,) = [node for node in module.body if isinstance(node, ast.If)]
    seen = {
        alias.name: str(node.module).removeprefix("sar_compiler.")
        for node in typed.body
        if isinstance(node, ast.ImportFrom)
        for alias in node.names
    }
    assert seen == sar_compiler._HOMES
    assert sorted(seen) == sorted(sar_compiler.__all__)


def test_type_checkers_know_the_names(tmp_path):
    program = tmp_path / "typed.py"
    program.write_text(
        "import sar_compiler\n"
        'tree = sar_compiler.load("x.xml").compile(parameters={"n": 1})\n'
        "reveal_type(tree)\nreveal_type(sar_compiler.Kind.ACTION)\n",
        encoding="utf-8",
    )
    done = subprocess.run(
        [sys.executable, "-m", "mypy", "--strict", str(program)], capture_output=True, text=True, check=False
    )
    assert 'Revealed type is "sar_compiler.compiler.CompiledTree"' in done.stdout, done.stdout
    assert "sar_compiler.nodes.spec.Kind" in done.stdout


def imported(text):
    """Yield the modules of this package that a piece of Python imports from."""
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.ImportFrom) and node.module:
            yield node.module
        elif isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)


@pytest.mark.parametrize("page", [*PAGES, *FINDINGS], ids=str)
def test_a_page_imports_from_the_face_only(page):
    texts = [block.text for block in blocks(page) if block.language == "python"]
    # What is shown of a class may have no body.
    whole = [text if not text.rstrip().endswith(")") else f"{text}class _: ..." for text in texts]
    modules = {module for text in whole for module in imported(text) if re.match(r"sar_compiler\b", module)}
    assert modules <= PUBLIC


@pytest.mark.parametrize("page", [page for page in PAGES if page.name != "architecture.md"], ids=str)
def test_a_page_for_users_names_no_module_behind_the_face(page):
    named = set(re.findall(r"\bsar_compiler\.\w+\.\w+", page.read_text("utf-8")))
    assert {name for name in named if not name.startswith("sar_compiler.testing.")} == set()


@pytest.mark.parametrize("path", sorted(Path("examples").rglob("*.py")), ids=str)
def test_an_example_imports_from_the_face_only(path):
    modules = {each for each in imported(path.read_text("utf-8")) if re.match(r"sar_compiler\b", each)}
    assert modules <= PUBLIC
