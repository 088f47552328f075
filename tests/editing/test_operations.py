"""Tests of operations on elements: their text edits match the same operations on plain lists."""

import re
from collections import Counter
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sar_compiler.editing.operations import EditedFile, edits_of
from sar_compiler.editing.text_edits import EditError, TextEdit, apply_edits
from sar_compiler.tree.discovery import parse_tree
from sar_compiler.tree.xml_writer import write_xml
from sar_compiler.tree.yaml_writer import write_yaml
from tests.tree.strategies import ATTRIBUTES, TAGS, VALUES, tree_files

SHIPPED = sorted([*Path("trees").glob("*.*"), *Path("examples").rglob("*tree*.xml")])


def as_lists(element):
    """Return an element as a list of its tag, attributes and children."""
    return [element.tag, dict(element.attributes), [as_lists(child) for child in element.children]]


def nodes_with_parents(node, parent=None):
    """Return all nodes of a nested list in document order, each with its parent."""
    return [(node, parent), *(pair for child in node[2] for pair in nodes_with_parents(child, node))]


def index_of(node, parent):
    return next(index for index, each in enumerate(parent[2]) if each is node)


def inverse_edits(text, edits):
    """Return the edits that restore the original text from the edited one."""
    inverse, growth = [], 0
    for edit in sorted(edits):
        start = edit.start + growth
        inverse.append(TextEdit(start, start + len(edit.text), text[edit.start : edit.end]))
        growth += len(edit.text) - (edit.end - edit.start)
    return inverse


class Model:
    """The operations on lists, with the names and arguments of `operations`."""

    def __init__(self, root):
        self.root = root

    def node_at(self, number):
        return nodes_with_parents(self.root)[number]

    def move(self, element, parent, index):
        (node, old), (new, _) = self.node_at(element), self.node_at(parent)
        place = index_of(node, old)
        new[2].insert(index, [*node])
        del old[2][place + (old is new and index <= place)]

    def insert(self, parent, index, tag, attributes):
        self.node_at(parent)[0][2].insert(index, [tag, dict(attributes), []])

    def wrap(self, element, tag, attributes, last):
        node, parent = self.node_at(element)
        first, end = index_of(node, parent), index_of(self.node_at(last)[0], parent) + 1
        parent[2][first:end] = [[tag, dict(attributes), parent[2][first:end]]]

    def unwrap(self, element):
        node, parent = self.node_at(element)
        place = index_of(node, parent)
        parent[2][place : place + 1] = node[2]

    def delete(self, element):
        node, parent = self.node_at(element)
        del parent[2][index_of(node, parent)]

    def duplicate(self, element):
        node, parent = self.node_at(element)
        parent[2].insert(index_of(node, parent), node)

    def set_attribute(self, element, name, value):
        node, _ = self.node_at(element)
        node[1].pop(name, None) if value is None else node[1].update({name: value})


@st.composite
def operations(draw, tree_file):
    """A possible operation on a file, with its arguments."""
    pairs = nodes_with_parents(as_lists(tree_file.root))
    number = {id(node): index for index, (node, _) in enumerate(pairs)}
    attributes = draw(st.dictionaries(ATTRIBUTES, VALUES, max_size=2))
    element = draw(st.integers(1, len(pairs) - 1)) if len(pairs) > 1 else 0
    node, parent = pairs[element]
    of_all = ["insert", "set_attribute"]
    of_children = ["move", "wrap", "delete", "duplicate", *(["unwrap"] if node[2] else [])]
    name = draw(st.sampled_from([*of_all, *of_children] if parent else of_all))
    if name == "set_attribute":
        key = draw(st.sampled_from([*node[1]]) if node[1] and draw(st.booleans()) else ATTRIBUTES)
        return name, {"element": element, "name": key, "value": draw(st.none() | VALUES)}
    if name == "wrap":
        last = draw(st.sampled_from(parent[2][index_of(node, parent) :]))
        return name, {
            "element": element,
            "tag": draw(TAGS),
            "attributes": attributes,
            "last": number[id(last)],
        }
    if name in ("insert", "move"):
        inside = {id(each) for each, _ in nodes_with_parents(node)} if name == "move" else set()
        target = draw(st.sampled_from([each for each, _ in pairs if id(each) not in inside]))
        place = {"parent": number[id(target)], "index": draw(st.integers(0, len(target[2])))}
        return name, (
            {**place, "element": element}
            if name == "move"
            else {**place, "tag": draw(TAGS), "attributes": attributes}
        )
    return name, {"element": element}


def in_one_line(text):
    """Return an XML text with all tags in one line."""
    return re.sub(r">\s*\n\s*(?=<)", ">", text)


def to_flow_style(tree_file):
    """Return a YAML text that is in flow style below the first tag."""

    def quoted(text):
        return '"' + "".join(f"\\U{ord(each):08x}" for each in text) + '"'

    def written(element):
        children = ", ".join(map(written, element.children))
        entries = [f"{quoted(name)}: {quoted(value)}" for name, value in element.attributes.items()]
        entries += [f"children: [{children}]"] if children else []
        return f"{quoted(element.tag)}: {{{', '.join(entries)}}}" if entries else quoted(element.tag)

    return f"# before\n{written(tree_file.root)}  # behind\n"


LAYOUTS = {
    "canonical.xml": write_xml,
    "one_line.xml": lambda file: in_one_line(write_xml(file)),
    "crlf.xml": lambda file: write_xml(file).replace("\n", "\r\n"),
    "canonical.yaml": write_yaml,
    "brackets.yaml": to_flow_style,
}


def require_equal_to_model(tree_file, name, arguments):
    """Require that an operation on a text equals the one on lists, and that its inverse restores the text; return the new file."""
    text, path = tree_file.source.text, tree_file.source.path
    edits = edits_of(tree_file, name, **arguments)
    edited = apply_edits(text, edits)
    changed = parse_tree(edited, path)
    expected = Model(as_lists(tree_file.root))
    getattr(expected, name)(**arguments)
    assert as_lists(changed.root) == expected.root
    assert apply_edits(edited, inverse_edits(text, edits)) == text
    return changed


def comments_of(tree_file):
    return Counter(
        each.text
        for one in (tree_file, *tree_file.root.iterate())
        for each in one.comments
        for _ in each.text[:1]
    )


@pytest.mark.parametrize("layout", LAYOUTS)
@given(st.data())
def test_random_operation_equals_list_operation_and_is_invertible(layout, data):
    made = data.draw(tree_files())
    tree_file = parse_tree(LAYOUTS[layout](made), layout)
    for _ in range(2):
        name, arguments = data.draw(operations(tree_file))
        before = comments_of(tree_file)
        tree_file = require_equal_to_model(tree_file, name, arguments)
        if name in ("move", "insert") or (name == "wrap" and layout.endswith("xml")):
            assert comments_of(tree_file) == before


@pytest.mark.parametrize("path", SHIPPED, ids=str)
@given(st.data())
def test_operation_on_shipped_tree_replaces_only_its_elements(path, data):
    tree_file = parse_tree(path.read_text(), str(path))
    name, arguments = data.draw(operations(tree_file))
    require_equal_to_model(tree_file, name, arguments)
    elements = EditedFile(tree_file).elements
    concerned = elements[arguments.get("element", 0)]
    last = elements[arguments.get("last", arguments.get("element", 0))]
    meant = {id(each) for one in (concerned, last) for each in one.iterate()}
    if name in ("wrap", "unwrap"):
        return
    replaced = [
        each
        for edit in edits_of(tree_file, name, **arguments)
        for each in elements
        if edit.start <= each.offset < edit.end and id(each) not in meant
    ]
    assert replaced == []


XML = """<root BTCPP_format="4">
  <BehaviorTree ID="Main">
    <Sequence>
      <!-- about A -->
      <A  x='1'/> <!-- beside A -->

      <!-- apart -->

      <B y="{k}"
         z="2"/>
    </Sequence>
  </BehaviorTree>
</root>
"""
YAML = """root:
  BTCPP_format: 4
  children:
    - BehaviorTree:
        ID: Main
        children:
          - Sequence:
              children:
                # about A
                - A:  # beside A
                    x: '1'
                    # below A

                # apart

                - B: {y: '{k}',   z: "2"}
"""


def apply_operation(text, operation, path="tree.xml", /, **arguments):
    return apply_edits(text, edits_of(parse_tree(text, path), operation, **arguments))


def test_node_is_moved_with_its_comments_and_nothing_else_changes():
    lines = XML.splitlines(keepends=True)
    assert apply_operation(XML, "move", element=3, parent=2, index=2) == "".join(
        [*lines[:3], *lines[5:10], *lines[3:5], *lines[10:]]
    )
    lines = YAML.splitlines(keepends=True)
    moved = apply_operation(
        YAML.replace("{y: '{k}',   z: \"2\"}", ""), "move", "t.yaml", element=3, parent=2, index=2
    )
    assert moved == "".join([*lines[:8], *lines[12:15], "                - B: \n", *lines[8:12]])


@pytest.mark.parametrize(
    ("operation", "arguments", "below"),
    [
        ("set_attribute", {"element": 2, "name": "x", "value": "1"}, "x: 1"),
        ("insert", {"parent": 2, "index": 0, "tag": "B"}, "children:\n                - B"),
    ],
)
def test_bare_tag_at_end_of_file_without_newline_gets_content(operation, arguments, below):
    text = "root:\n  children:\n    - BehaviorTree:\n        children:\n          - A"
    assert apply_operation(text, operation, "t.yaml", **arguments) == f"{text}:\n              {below}"


def test_exchanging_equal_nodes_makes_no_edit():
    text = XML.replace('<B y="{k}"\n         z="2"/>', "<A/>\n      <A/>")
    assert edits_of(parse_tree(text, "tree.xml"), "move", element=4, parent=2, index=3) == []


def test_attribute_change_keeps_quotes_and_layout():
    assert apply_operation(XML, "set_attribute", element=3, name="x", value="it's") == XML.replace(
        "'1'", "'it&apos;s'"
    )
    assert apply_operation(XML, "set_attribute", element=4, name="q", value="3") == XML.replace(
        '"2"', '"2"\n         q="3"'
    )
    assert apply_operation(XML, "set_attribute", element=4, name="z") == XML.replace('\n         z="2"', "")
    assert apply_operation(YAML, "set_attribute", "t.yaml", element=4, name="z") == YAML.replace(
        ',   z: "2"', ""
    )
    changed = apply_operation(YAML, "set_attribute", "t.yaml", element=4, name="q", value="a,b")
    assert changed == YAML.replace('"2"', "\"2\", q: 'a,b'")
    in_brackets = YAML[: YAML.index("\n                # about A")] + " [A, B]\n"
    changed = apply_operation(in_brackets, "set_attribute", "t.yaml", element=3, name="q", value="3")
    assert changed == in_brackets.replace("[A,", "[A: {q: 3},")


@pytest.mark.parametrize(("text", "path"), [(XML, "t.xml"), (YAML, "t.yaml")])
def test_extracted_subtree_shares_keys_and_can_be_inlined(text, path):
    extracted = apply_operation(text, "extract", path, element=4, tree="Part")
    root = parse_tree(extracted, path).root
    assert root.attributes["main_tree_to_execute"] == "Main"
    call = root.children[0].children[0].children[1]
    assert (call.tag, call.attributes) == ("SubTree", {"ID": "Part", "_autoremap": "true"})
    assert as_lists(root.children[1]) == ["BehaviorTree", {"ID": "Part"}, [["B", {"y": "{k}", "z": "2"}, []]]]
    inlined = parse_tree(apply_operation(extracted, "inline", path, element=4), path)
    assert as_lists(inlined.root.children[0]) == as_lists(parse_tree(text, path).root.children[0])


CALL = """<root BTCPP_format="4" main_tree_to_execute="Main">
  <BehaviorTree ID="Main"><SubTree ID="Part" {}/></BehaviorTree>
  <BehaviorTree ID="Part">
    <A x="{{k}}" y="{{other}}"/>
  </BehaviorTree>
</root>
"""


def test_keys_of_inlined_subtree_are_replaced_by_its_ports():
    inlined = apply_operation(CALL.format('k="{outer}" other="5"'), "inline", element=2)
    assert '<BehaviorTree ID="Main"><A x="{outer}" y="5"/></BehaviorTree>' in inlined


@pytest.mark.parametrize(
    ("ports", "reason"),
    [('_skipIf="true"', "has '_skipIf'"), ('ID2="{k}"/><A x="{k}"', "the key 'k' has another meaning")],
)
def test_subtree_whose_meaning_would_change_is_not_inlined(ports, reason):
    with pytest.raises(EditError, match=reason):
        apply_operation(CALL.format(ports), "inline", element=2)


@pytest.mark.parametrize(
    ("operation", "arguments", "reason"),
    [
        ("move", {"element": 2, "parent": 3, "index": 0}, "<Sequence> cannot be moved into itself"),
        ("move", {"element": 0, "parent": 3, "index": 0}, "<root> contains the whole file"),
        ("move", {"element": 3, "parent": 2, "index": 3}, "3 is not a position among the children of"),
        ("wrap", {"element": 4, "tag": "A", "last": 3}, "not adjacent siblings"),
        ("unwrap", {"element": 3}, "<A> has no children. Delete it instead"),
        ("delete", {"element": 9}, "there is no element 9"),
        ("inline", {"element": 3}, "<A> does not use a tree of this file"),
        ("extract", {"element": 3, "tree": "Main"}, "there is already a tree 'Main'"),
        ("extract", {"element": 1, "tree": "New"}, "'Main' is already a tree"),
        ("insert", {"parent": 3, "index": 0, "tag": "<"}, "this change would make the file invalid"),
        ("delete", {}, "the arguments of 'delete' are wrong"),
        ("burn", {}, "unknown operation 'burn'"),
    ],
)
def test_impossible_operation_reports_the_reason(operation, arguments, reason):
    with pytest.raises(EditError, match=re.escape(reason)):
        apply_operation(XML, operation, **arguments)


def test_comment_below_deleted_child_does_not_join_text_above():
    head = "Sequence:\n  name: |-\n    a := 1;\n    b := 2\n"
    tree_file = parse_tree(f"{head}  children:\n    - Sleep\n    # wait here\n", "tree.yaml")
    edits = edits_of(tree_file, "delete", element=1)
    assert apply_edits(tree_file.source.text, edits) == f"{head}  # wait here\n"
