"""Tests of the public names: they are lazy, typed and documented, and pages and examples use no others."""

import ast
import collections
import importlib
import itertools
import re
import runpy
import subprocess
import sys
from pathlib import Path

import pytest

from tests.docs.markdown import PAGES, blocks

FINDINGS = sorted(Path("docs/findings").glob("*.md"))
GROUPS = {
    name: importlib.import_module(name)
    for name in (
        "sar_compiler",
        "sar_compiler.execution",
        "sar_compiler.leaves",
        "sar_compiler.missions",
        "sar_compiler.testing",
    )
}
PUBLIC = [f"{group}.{name}" for group, module in GROUPS.items() for name in module.__all__]
# `testing` is an ordinary module that defines its names.
LAZY = [group for group in GROUPS if group != "sar_compiler.testing"]
ROS = {
    "sar_compiler.TreeRunner",
    "sar_compiler.running_tree",
    "sar_compiler.missions.DataNode",
    "sar_compiler.missions.flat_parameters",
    "sar_compiler.missions.serve",
    "sar_compiler.missions.convert_ros_errors",
}
MAX_NAMES_OF_FIRST_GROUP = 20
"""The maximum number of names in the first group, which a user can learn in an hour."""


def in_python(program):
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return done.stdout.strip()


def test_first_group_has_at_most_20_names():
    assert len(GROUPS["sar_compiler"].__all__) <= MAX_NAMES_OF_FIRST_GROUP


def test_public_name_is_in_one_group():
    names = collections.Counter(name.rpartition(".")[2] for name in PUBLIC)
    # `LoadedTree.simulate` and `testing.simulate` both return it.
    assert {name for name, count in names.items() if count > 1} == {"Simulated"}


@pytest.mark.parametrize("group", LAZY)
def test_public_names_of_group_are_available_without_ros(group):
    names = sorted(set(GROUPS[group].__all__) - {name.rpartition(".")[2] for name in ROS})
    asked = "; ".join(f"group.{name}" for name in names)
    assert in_python(f"import sys; sys.modules['rclpy'] = None\nimport {group} as group; {asked}") == ""


@pytest.mark.ros
@pytest.mark.parametrize("name", sorted(ROS))
def test_public_name_for_ros_is_callable(name):
    group, _, attribute = name.rpartition(".")
    assert callable(getattr(GROUPS[group], attribute))


def source_of(group, name):
    """Return the path of the source that defines a public name: the module from which the group imports it, or the group."""
    source = Path(sys.modules[group].__file__ or "")
    home = next(
        (
            node.module
            for node in ast.walk(ast.parse(source.read_text("utf-8")))
            if isinstance(node, ast.ImportFrom) and name in {alias.name for alias in node.names}
        ),
        group,
    )
    path = Path(*(home or "").split("."))
    return path / "__init__.py" if path.is_dir() else path.with_suffix(".py")


def doc_of(node, after, name):
    """Return the docstring that a statement gives to a name. That of a constant or an alias is the next statement."""
    if isinstance(node, (ast.ClassDef, ast.FunctionDef)):
        return node.name == name and ast.get_docstring(node)
    targets = node.targets if isinstance(node, ast.Assign) else [getattr(node, "target", None)]
    given = name in {
        part.id for each in targets if each for part in ast.walk(each) if isinstance(part, ast.Name)
    }
    is_text = isinstance(after, ast.Expr) and isinstance(after.value, ast.Constant)
    return given and is_text and after.value.value


@pytest.mark.parametrize("name", PUBLIC)
def test_public_name_is_documented(name):
    group, _, attribute = name.rpartition(".")
    body = ast.parse(source_of(group, attribute).read_text("utf-8")).body
    texts = [doc_of(node, after, attribute) for node, after in itertools.pairwise([*body, None])]
    assert any(texts)


@pytest.mark.parametrize("group", LAZY)
def test_importing_a_group_imports_no_library(group):
    libraries = ("py_trees", "lxml", "rclpy", "yaml")
    assert in_python(f"import sys, {group}; print([x for x in {libraries} if x in sys.modules])") == "[]"


@pytest.mark.parametrize("group", LAZY)
def test_unknown_name_is_no_attribute(group):
    with pytest.raises(AttributeError, match=f"module '{group}' has no attribute 'Regsitry'"):
        GROUPS[group].Regsitry  # noqa: B018


@pytest.mark.parametrize("group", GROUPS)
def test_all_public_names_are_listed_for_completion(group):
    assert set(GROUPS[group].__all__) <= set(dir(GROUPS[group]))


@pytest.mark.parametrize("group", LAZY)
def test_names_for_type_checkers_match_runtime_names(group):
    module = ast.parse(Path(GROUPS[group].__file__ or "").read_text(encoding="utf-8"))
    typed = next(node for node in module.body if isinstance(node, ast.If))
    seen = {
        alias.name: node.module
        for node in typed.body
        if isinstance(node, ast.ImportFrom)
        for alias in node.names
    }
    assert sorted(seen) == sorted(GROUPS[group].__all__)
    for name in sorted({*seen} - {name.rpartition(".")[2] for name in ROS}):
        assert getattr(GROUPS[group], name) is getattr(importlib.import_module(str(seen[name])), name)


@pytest.mark.costly
def test_mypy_knows_the_public_names(tmp_path):
    program = tmp_path / "typed.py"
    program.write_text(
        "import sar_compiler\n"
        "from sar_compiler.leaves import Kind, Knid\n"
        'tree = sar_compiler.load("x.xml").compile(parameters={"n": 1})\n'
        "reveal_type(tree)\nreveal_type(Kind.ACTION)\n",
        encoding="utf-8",
    )
    done = subprocess.run(
        [sys.executable, "-m", "mypy", "--strict", str(program)], capture_output=True, text=True, check=False
    )
    assert 'Revealed type is "sar_compiler.compiler.CompiledTree"' in done.stdout, done.stdout
    assert "sar_compiler.nodes.spec.Kind" in done.stdout
    assert '"sar_compiler.leaves" has no attribute "Knid"' in done.stdout


def modules_imported_by(text):
    """Yield the modules of this package that a piece of Python imports from."""
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.ImportFrom) and node.module:
            yield node.module
        elif isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)


@pytest.mark.parametrize("page", [*PAGES, *FINDINGS], ids=str)
def test_page_imports_only_public_modules(page):
    texts = [block.text for block in blocks(page) if block.language == "python"]
    # A page may show a class without its body.
    whole = [text if not text.rstrip().endswith(")") else f"{text}class _: ..." for text in texts]
    modules = {
        module
        for text in whole
        for module in modules_imported_by(text)
        if re.match(r"sar_compiler\b", module)
    }
    assert modules <= set(GROUPS)


@pytest.mark.parametrize("page", [page for page in PAGES if page.name != "architecture.md"], ids=str)
def test_user_page_names_no_internal_module(page):
    named = set(re.findall(r"\bsar_compiler\.\w+\.\w+", page.read_text("utf-8")))
    assert {name for name in named if name.rpartition(".")[0] not in GROUPS} == set()


@pytest.mark.parametrize("path", sorted(Path("examples").rglob("*.py")), ids=str)
def test_example_imports_only_public_modules(path):
    modules = {
        each for each in modules_imported_by(path.read_text("utf-8")) if re.match(r"sar_compiler\b", each)
    }
    assert modules <= set(GROUPS)


def test_api_page_matches_sources_and_has_every_public_name():
    api = runpy.run_path("docs/site/api_page.py")
    text = api["PAGE"].read_text(encoding="utf-8")
    assert text == api["page"](), "renew it: .venv/bin/python docs/site/api_page.py"
    for group, module in GROUPS.items():
        section = text.partition(f"\n## {group}\n")[2].partition("\n## ")[0]
        assert {*re.findall(r"^- \*\*`(\w+)", section, re.MULTILINE)} == {*module.__all__}


def test_readme_pictures_match_current_output():
    demo, badges = (runpy.run_path(f"docs/pictures/{name}.py") for name in ("demo", "badges"))
    drawn = demo["PICTURE"].read_text(encoding="utf-8")
    typo, proof = demo["checked"](demo["tree_of_readme"]())
    shown = demo["picture"](typo, proof, [])
    # The scene of the simulated run comes last and is not compared.
    assert drawn.partition('<g class="scene2">')[0] == shown.partition('<g class="scene2">')[0], (
        "renew it: .venv/bin/python docs/pictures/demo.py"
    )
    readme = Path("README.md").read_text(encoding="utf-8")
    for path, badge in badges["pictures"]().items():
        assert path.read_text(encoding="utf-8") == badge, "make pictures"
        assert f"](docs/pictures/{path.name})" in readme
