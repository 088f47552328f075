"""Tests of the differences between two trees that `sar-compile diff` lists."""

import itertools

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sar_compiler.tree.xml import parse_xml
from sar_compiler.tree.yaml import parse_yaml
from sar_compiler.tree.yaml_writer import write_yaml
from sar_compiler.views.difference import Change, difference, difference_as_text
from sar_compiler.views.matching import common_subsequence
from tests.tree.strategies import tree_files
from tests.trees import document

TREE = """
<Selector name="Mission" memory="false">
  <Sequence name="Patrol">
    <Look/>
    <Drive goal="a"/>
    <Drive goal="b"/>
    <Say name="Report" message="found" times="2"/>
  </Sequence>
  <Sequence name="Home">
    <Drive goal="home"/>
    <Rest/>
  </Sequence>
</Selector>
"""


def differences(old, new):
    return difference(parse_xml(old, "a.xml"), parse_xml(new, "b.xml"))


def change_lines(old, new):
    """Return the lines that describe the change from one tree to another, without file locations."""
    lines = difference_as_text(differences(document(old), document(new))).splitlines()
    return [" ".join(line.rsplit("  (", maxsplit=1)[0].split()) for line in lines]


def replace_in_tree(*replacements):
    """Return `TREE` with replaced texts, each of which it must contain."""
    tree = TREE
    for old, new in replacements:
        assert old in tree
        tree = tree.replace(old, new)
    return tree


def test_tree_does_not_differ_from_itself():
    assert change_lines(TREE, TREE) == []


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("<Look/>", "<!-- first --><Look  ></Look>"),
        ('name="Report" message="found"', 'message="found" name="Report"'),
        ("<Look/>", '<Action ID="Look"/>'),
        ("\n", "\r\n"),
    ],
    ids=["comments and space", "the order of attributes", "the explicit form", "line ends"],
)
def test_formatting_is_not_a_difference(old, new):
    assert change_lines(TREE, replace_in_tree((old, new))) == []


def test_xml_and_yaml_of_same_tree_do_not_differ():
    in_xml = parse_xml(document(TREE).replace("<root", '<root xmlns:xsi="x" xsi:schemaLocation="y"'))
    assert difference(in_xml, parse_yaml(write_yaml(parse_xml(document(TREE))))) == []


def test_order_of_trees_is_not_a_difference():
    one, other = '<BehaviorTree ID="A"><X/></BehaviorTree>', '<BehaviorTree ID="B"><Y/></BehaviorTree>'
    assert differences(f"<root>{one}{other}</root>", f"<root>{other}{one}</root>") == []


def test_order_of_node_models_is_not_a_difference():
    one, other = '<Action ID="A"><input_port name="p"/><input_port name="q"/></Action>', '<Action ID="B"/>'
    old = f"<root><TreeNodesModel>{one}{other}</TreeNodesModel></root>"
    new = f"<root><include path='x'/><TreeNodesModel>{other}{one}</TreeNodesModel></root>"
    assert [found.path for found in differences(old, new)] == ["x"]


@pytest.mark.parametrize(
    ("replacement", "line"),
    [
        (('message="found"', 'message="lost"'), 'Report: message "found" -> "lost"'),
        ((' times="2"', ""), 'Report: times "2" -> not written'),
        (('name="Report"', 'name="Report" loud="yes"'), 'Report: loud not written -> "yes"'),
        (('message="found"', 'message="a&#10;b"'), 'Report: message "found" -> "a\\nb"'),
        (('name="Report"', 'name="Tell"'), 'Tell: name "Report" -> "Tell"'),
        (("<Say ", "<Shout "), "Report: <Say> -> <Shout>"),
    ],
    ids=["changed", "gone", "new", "two lines", "renamed", "another tag"],
)
def test_changed_attribute_is_listed_with_old_and_new_value(replacement, line):
    assert change_lines(TREE, replace_in_tree(replacement)) == [f"changed Main/Mission/Patrol/{line}"]


def test_renamed_node_is_matched_by_its_content():
    new = replace_in_tree(('name="Patrol"', 'name="Tour"'), ("<Look/>", ""))
    assert change_lines(TREE, new) == [
        'changed Main/Mission/Tour: name "Patrol" -> "Tour"',
        "removed Main/Mission/Patrol/Look <Look>",
    ]


def test_node_with_other_name_and_content_is_not_matched():
    new = replace_in_tree(
        ('<Say name="Report" message="found" times="2"/>', '<Say name="Sing" message="la" times="9"/>')
    )
    assert change_lines(TREE, new) == [
        "removed Main/Mission/Patrol/Report <Say>",
        "added Main/Mission/Patrol/Sing <Say>",
    ]


def test_unnamed_nodes_are_matched_by_tag_and_position():
    assert change_lines(TREE, replace_in_tree(('goal="b"', 'goal="c"'))) == [
        'changed Main/Mission/Patrol/Drive[2]: goal "b" -> "c"'
    ]


def test_control_node_with_same_children_is_matched_despite_other_tag():
    new = replace_in_tree(
        ('<Selector name="Mission" memory="false">', "<Fallback>"), ("</Selector>", "</Fallback>")
    )
    assert change_lines(TREE, new) == [
        "changed Main/Fallback: <Selector> -> <Fallback>",
        'changed Main/Fallback: name "Mission" -> not written',
        'changed Main/Fallback: memory "false" -> not written',
    ]


def test_added_and_removed_nodes_are_listed_with_descendant_count():
    new = replace_in_tree(("<Look/>", "<Inverter><Retry><Listen/></Retry></Inverter>"))
    assert change_lines(TREE, new) == [
        "removed Main/Mission/Patrol/Look <Look>",
        "added Main/Mission/Patrol/Inverter <Inverter>, with 2 nodes in it",
    ]
    assert change_lines(new, TREE) == [
        "removed Main/Mission/Patrol/Inverter <Inverter>, with 2 nodes in it",
        "added Main/Mission/Patrol/Look <Look>",
    ]


def test_node_wrapped_in_new_node_is_listed_as_moved():
    assert change_lines(TREE, replace_in_tree(("<Look/>", '<Inverter name="Not"><Look/></Inverter>'))) == [
        "added Main/Mission/Patrol/Not <Inverter>",
        "moved Main/Mission/Patrol/Look -> Main/Mission/Patrol/Not/Look",
    ]


def test_node_unwrapped_from_removed_node_is_listed_as_moved():
    old = replace_in_tree(("<Look/>", '<Inverter name="Not"><Look/></Inverter>'))
    assert change_lines(old, TREE) == [
        "removed Main/Mission/Patrol/Not <Inverter>",
        "moved Main/Mission/Patrol/Not/Look -> Main/Mission/Patrol/Look",
    ]


def test_node_can_move_to_other_parent_and_change():
    new = replace_in_tree(
        ('<Say name="Report" message="found" times="2"/>', ""),
        ("<Rest/>", '<Rest/><Say name="Report" message="lost"/>'),
    )
    assert change_lines(TREE, new) == [
        "moved Main/Mission/Patrol/Report -> Main/Mission/Home/Report",
        'changed Main/Mission/Home/Report: message "found" -> "lost"',
        'changed Main/Mission/Home/Report: times "2" -> not written',
    ]


def test_swapping_two_siblings_is_one_move():
    new = replace_in_tree(('<Drive goal="home"/>\n    <Rest/>', '<Rest/>\n    <Drive goal="home"/>'))
    assert change_lines(TREE, new) == ["moved Main/Mission/Home/Drive: child 1 -> child 2"]


def test_removed_tree_is_one_change():
    whole = document(TREE).replace("</root>", '<BehaviorTree ID="Spare"><Rest/></BehaviorTree></root>')
    text = difference_as_text(differences(whole, document(TREE)))
    assert text == "removed  Spare <BehaviorTree>, with 1 node in it  (a.xml:18)\n"


def test_other_main_tree_is_a_change_of_the_root():
    lines = difference_as_text(
        differences('<root main_tree_to_execute="A"/>', '<root main_tree_to_execute="B"/>')
    )
    assert lines == 'changed  root: main_tree_to_execute "A" -> "B"  (a.xml:1, b.xml:1)\n'


def test_changed_port_description_is_listed():
    model = '<root><TreeNodesModel><Action ID="Say"><input_port name="m">{}</input_port></Action></TreeNodesModel></root>'
    lines = difference_as_text(differences(model.format("What."), model.format("Which.")))
    assert lines.startswith('changed  TreeNodesModel/Say/m: description "What." -> "Which."')


def test_change_names_line_in_both_files():
    found = differences(document(TREE), "\n" + document(replace_in_tree(('goal="home"', 'goal="base"'))))
    assert difference_as_text(found) == (
        'changed  Main/Mission/Home/Drive: goal "home" -> "base"  (a.xml:12, b.xml:13)\n'
    )


def flat_tree(leaves):
    return document(f"<Sequence>{''.join(leaves)}</Sequence>")


@pytest.mark.costly
@pytest.mark.unmeasured
@pytest.mark.parametrize(
    ("old", "new", "changes"),
    [
        (["<Say/>"] * 10_000, ["<Say/>"] * 9_999, 1),
        (
            [f'<Say message="{n}"/>' for n in range(10_000)],
            [f'<Say message="{n}"/>' for n in range(9_999, -1, -1)],
            9_999,
        ),
        (
            [f'<Say name="a{n}"/>' for n in range(10_000)],
            [f'<Say name="b{n}"/>' for n in range(10_000)],
            10_000,
        ),
    ],
    ids=["all alike", "in reverse", "all renamed"],
)
def test_trees_of_ten_thousand_nodes_are_compared(old, new, changes):
    assert len(differences(flat_tree(old), flat_tree(new))) == changes


@given(tree_files())
def test_random_tree_does_not_differ_from_itself(tree_file):
    assert difference(tree_file, tree_file) == []


@given(tree_files(), tree_files())
def test_random_trees_have_symmetric_and_consistent_differences(old, new):
    found = difference(old, new)
    assert bool(found) == bool(difference(new, old))
    if old.root == new.root:
        assert found == []
    for one in found:
        assert (one.old is None) == (one.change is Change.ADDED)
        assert (one.new is None) == (one.change is Change.REMOVED)


LISTS = st.lists(st.sampled_from("abcd"), max_size=9)


@given(LISTS, LISTS)
def test_common_subsequence_is_the_longest(old, new):
    pairs = common_subsequence(old, new)
    assert all(old[i] == new[j] for i, j in pairs)
    assert all(i < k and j < m for (i, j), (k, m) in itertools.pairwise(pairs))
    assert len(pairs) == longest_length(old, new)


def longest_length(old, new):
    lengths = [0] * (len(new) + 1)
    for one in old:
        before = lengths[:]
        for j, other in enumerate(new):
            lengths[j + 1] = before[j] + 1 if one == other else max(before[j + 1], lengths[j])
    return lengths[-1]
