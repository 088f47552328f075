"""Tests that `show` draws every file that can be parsed in each format, even if it has errors."""

import json
import re
import tempfile
import warnings
from pathlib import Path

import pydot
import pytest
from hypothesis import given, settings
from lxml import etree

from sar_compiler import TreeError, load
from sar_compiler.cli.compile import _drawing
from sar_compiler.compiler.sketch import Sketch, sketch_tree
from sar_compiler.tree.discovery import tree_files_in
from tests.cli.command_runner import run
from tests.docs.test_findings import CODES, page_of
from tests.fuzz.random_trees import wrong_tree_texts
from tests.lsp.test_same_as_validate import WRITTEN
from tests.random_inputs import rounds
from tests.trees import document

SVG = "{http://www.w3.org/2000/svg}"
FORMS = ("unicode", "ascii", "json", "svg", "dot", "mermaid")
FILES = [
    path
    for folder in ("trees", "examples", "tests")
    for path in tree_files_in(Path(folder))
    if b"BehaviorTree" in path.read_bytes()
]


def sample_texts():
    """Yield the texts of tree files in the tests and in the pages of findings, with a file name ending."""
    for text, ending in WRITTEN.values():
        yield text if isinstance(text, str) else text.decode("utf-8", "replace"), ending
    for code in CODES:
        for block in page_of(code).sections["Bad"]:
            if block.language in ("xml", "yaml") and "BehaviorTree" in block.text:
                yield block.text, f".{block.language}"


def node_names(outline):
    yield outline["name"]
    for child in outline["children"]:
        yield from node_names(child)


def drawings_of(tree):
    """Draw a tree in each format; check that each drawing is valid and that all have the same number of nodes."""
    sketch = tree.sketch()
    drawn = {form: _drawing(sketch, form, folded=False) for form in FORMS}
    count = len(list(node_names(json.loads(drawn["json"]))))
    assert len(drawn["unicode"].splitlines()) == len(drawn["ascii"].splitlines()) == count
    assert len([*etree.fromstring(drawn["svg"].encode()).iter(f"{SVG}g")]) == count
    assert len(re.findall(r":::\w+$", drawn["mermaid"], re.MULTILINE)) == count
    assert len(re.findall(r"^ *n\d+ \[label=", drawn["dot"], re.MULTILINE)) == count
    return drawn


@pytest.mark.parametrize("path", FILES, ids=str)
def test_project_file_is_drawn_in_each_format(path):
    drawings_of(load(path))


def test_parsable_texts_of_tests_and_pages_are_drawn_in_each_format(tmp_path):
    drawn = sketched = 0
    for text, ending in sample_texts():
        path = tmp_path / f"tree{ending}"
        path.write_text(text, encoding="utf-8", newline="")
        tree = load(path, isolated=True)
        if tree.is_malformed or not tree.forest.main.trees:
            continue
        drawings_of(tree)
        drawn += 1
        sketched += isinstance(tree.sketch(), Sketch)
    assert drawn > 140
    assert sketched > 80


@settings(max_examples=rounds(50))
@given(wrong_tree_texts())
def test_random_invalid_tree_is_drawn_in_each_format(text):
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "tree.xml"
        path.write_text(text, encoding="utf-8")
        drawings_of(load(path, isolated=True))


@pytest.mark.parametrize("path", [each for each in FILES if each.parent.name == "trees"], ids=str)
def test_valid_file_is_drawn_identically_compiled_and_uncompiled(path):
    tree = load(path)
    compiled, trees = tree.sketch(), tree.context.bound_forest.trees
    sketch = sketch_tree(next(each for each in trees if each.name == compiled.name), trees)
    assert not isinstance(compiled, Sketch)
    for form in FORMS:
        assert _drawing(sketch, form, folded=False) == _drawing(compiled, form, folded=False)


INVALID_TREE = """\
<Sequence name="top">
  <Fly name="up" to="{x}"><AlwaysSuccess/><Control ID="Hover"/></Fly>
  <Inverter><AlwaysSuccess/><AlwaysFailure/></Inverter>
  <SubTree ID="Gone" at="{x}"/>
  <SubTree ID="Main"/>
  <AlwaysSuccess _skipIf="x == 1" oneshot="ON_COMPLETION"><AlwaysFailure/></AlwaysSuccess>
  <NavigateToBse/>
</Sequence>
"""
INVALID_TREE_DRAWN = """\
{-} top
    --> up  <Fly> ?
        --> AlwaysSuccess
        --> Hover  ?
    -^- Inverter
        --> AlwaysSuccess
        --> AlwaysFailure
    -^- Gone  <SubTree>
    -^- Main  <SubTree>
    -^- AlwaysSuccessOneShot
        -^- AlwaysSuccessConditions
            --> AlwaysSuccess
                --> AlwaysFailure
    --> NavigateToBse  ?
"""


@pytest.fixture
def invalid_file(tmp_path):
    path = tmp_path / "wrong.xml"
    path.write_text(document(INVALID_TREE), encoding="utf-8")
    return path


def test_unknown_nodes_have_a_question_mark_and_missing_subtrees_are_folded(invalid_file, capsys):
    status, out, err = run(capsys, "show", invalid_file)
    assert (status, out) == (1, INVALID_TREE_DRAWN)
    assert err.count("error[unknown-node]") == 3
    assert all(f"error[{code}]" in err for code in ("unknown-tree", "recursive-tree", "too-many-children"))


def test_box_of_unknown_node_is_dashed_in_svg(invalid_file, capsys):
    status, out, _ = run(capsys, "show", "--format", "svg", invalid_file)
    assert status == 1
    picture, inside = etree.fromstring(out.encode()), {"s": SVG.strip("{}")}
    unknown = "//s:g[contains(@class, 'unknown')][s:path/@stroke-dasharray]/s:text[1]/text()"
    assert picture.xpath(unknown, namespaces=inside) == ["? up", "? Hover", "? NavigateToBse"]
    assert len(picture.xpath("//s:path[@stroke-dasharray]", namespaces=inside)) == 3


def test_graphviz_reads_drawing_with_unknown_nodes(invalid_file, capsys):
    _, out, _ = run(capsys, "show", "--format", "dot", invalid_file)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        graphs = pydot.graph_from_dot_data(out) or []
    assert len(graphs[0].get_edges()) == len(INVALID_TREE_DRAWN.splitlines()) - 1


def test_unknown_node_has_null_class_and_its_attributes_as_written(invalid_file, capsys):
    _, out, _ = run(capsys, "show", "--format", "json", invalid_file)
    fly, *_, near = json.loads(out)["children"]
    assert (fly["class"], fly["name"], fly["attributes"], fly["line"]) == (None, "up", {"to": "{x}"}, 4)
    assert near["class"] is None


def test_first_unused_tree_is_drawn_and_the_others_are_named(tmp_path, capsys):
    path = tmp_path / "two.xml"
    bodies = (("Part", "AlwaysSuccess"), ("One", 'SubTree ID="Part"'), ("Two", "AlwaysFailure"))
    trees = "".join(f'<BehaviorTree ID="{name}"><{tag}/></BehaviorTree>' for name, tag in bodies)
    path.write_text(f'<root BTCPP_format="4">{trees}</root>', encoding="utf-8")
    status, out, err = run(capsys, "show", path)
    assert (status, out.splitlines()[0]) == (0, "-^- Part  <SubTree>")
    assert err.startswith("note: this is the tree 'One'. Show another with --tree: Part, Two\n")
    assert run(capsys, "show", "--tree", "Two", path) == (0, "--> AlwaysFailure\n", "")


def test_empty_tree_is_one_box(tmp_path):
    path = tmp_path / "empty.xml"
    path.write_text('<root BTCPP_format="4"><BehaviorTree ID="Main"/></root>', encoding="utf-8")
    assert drawings_of(load(path))["unicode"] == "--> BehaviorTree  ?\n"


@pytest.mark.parametrize("text", ["<root>", '<root BTCPP_format="4"/>'])
def test_file_without_tree_cannot_be_drawn(tmp_path, text):
    path = tmp_path / "none.xml"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(TreeError):
        load(path).sketch()


def test_subtrees_with_too_many_nodes_are_folded(tmp_path, monkeypatch):
    monkeypatch.setattr("sar_compiler.compiler.sketch.MAX_NODES", 50)
    each = "".join(
        f'<BehaviorTree ID="T{number}"><Sequence><SubTree ID="T{number + 1}"/><SubTree ID="T{number + 1}"/></Sequence></BehaviorTree>'
        for number in range(20)
    )
    path = tmp_path / "many.xml"
    path.write_text(f'<root BTCPP_format="4" main_tree_to_execute="T0">{each}</root>', encoding="utf-8")
    assert 40 < len(drawings_of(load(path))["unicode"].splitlines()) < 120


def test_file_whose_main_tree_is_in_another_file_is_drawn_with_its_own_first_tree(tmp_path):
    (tmp_path / "main.xml").write_text(document("<AlwaysSuccess/>", main="Main"))
    path = tmp_path / "part.xml"
    path.write_text('<root BTCPP_format="4" main_tree_to_execute="Main"><BehaviorTree ID="Part"/></root>')
    assert load(path).sketch().name == "Part"
