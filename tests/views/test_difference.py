"""What `sar-compile diff` finds between two trees."""

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


def said(old, new):
    """Return what is said of the change from one tree to another, without the places in the files."""
    lines = difference_as_text(differences(document(old), document(new))).splitlines()
    return [" ".join(line.rsplit("  (", maxsplit=1)[0].split()) for line in lines]


def after(*replacements):
    """Return the tree after texts in it were replaced; each must be there."""
    tree = TREE
    for old, new in replacements:
        assert old in tree
        tree = tree.replace(old, new)
    return tree


def test_a_tree_does_not_differ_from_itself():
    assert said(TREE, TREE) == []


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
def test_what_says_nothing_of_the_tree_is_no_difference(old, new):
    assert said(TREE, after((old, new))) == []


def test_the_form_of_the_file_is_no_difference():
    in_xml = parse_xml(document(TREE).replace("<root", '<root xmlns:xsi="x" xsi:schemaLocation="y"'))
    assert difference(in_xml, parse_yaml(write_yaml(parse_xml(document(TREE))))) == []


def test_the_order_of_trees_is_no_difference():
    one, other = '<BehaviorTree ID="A"><X/></BehaviorTree>', '<BehaviorTree ID="B"><Y/></BehaviorTree>'
    assert differences(f"<root>{one}{other}</root>", f"<root>{other}{one}</root>") == []


def test_the_order_of_descriptions_is_no_difference():
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
def test_a_changed_attribute_is_told_with_what_it_was_and_is(replacement, line):
    assert said(TREE, after(replacement)) == [f"changed Main/Mission/Patrol/{line}"]


def test_a_renamed_node_is_the_same_node_where_most_of_its_content_is():
    new = after(('name="Patrol"', 'name="Tour"'), ("<Look/>", ""))
    assert said(TREE, new) == [
        'changed Main/Mission/Tour: name "Patrol" -> "Tour"',
        "removed Main/Mission/Patrol/Look <Look>",
    ]


def test_a_node_of_another_name_and_content_is_another_node():
    new = after(
        ('<Say name="Report" message="found" times="2"/>', '<Say name="Sing" message="la" times="9"/>')
    )
    assert said(TREE, new) == [
        "removed Main/Mission/Patrol/Report <Say>",
        "added Main/Mission/Patrol/Sing <Say>",
    ]


def test_a_node_of_the_same_kind_without_a_name_is_the_same_node_in_its_place():
    assert said(TREE, after(('goal="b"', 'goal="c"'))) == [
        'changed Main/Mission/Patrol/Drive[2]: goal "b" -> "c"'
    ]


def test_a_control_of_another_kind_around_the_same_nodes_is_the_same_node():
    new = after(('<Selector name="Mission" memory="false">', "<Fallback>"), ("</Selector>", "</Fallback>"))
    assert said(TREE, new) == [
        "changed Main/Fallback: <Selector> -> <Fallback>",
        'changed Main/Fallback: name "Mission" -> not written',
        'changed Main/Fallback: memory "false" -> not written',
    ]


def test_added_and_removed_nodes_are_told_with_the_number_of_those_in_them():
    new = after(("<Look/>", "<Inverter><Retry><Listen/></Retry></Inverter>"))
    assert said(TREE, new) == [
        "removed Main/Mission/Patrol/Look <Look>",
        "added Main/Mission/Patrol/Inverter <Inverter>, with 2 nodes in it",
    ]
    assert said(new, TREE) == [
        "removed Main/Mission/Patrol/Inverter <Inverter>, with 2 nodes in it",
        "added Main/Mission/Patrol/Look <Look>",
    ]


def test_a_node_that_was_put_into_a_new_one_has_moved():
    assert said(TREE, after(("<Look/>", '<Inverter name="Not"><Look/></Inverter>'))) == [
        "added Main/Mission/Patrol/Not <Inverter>",
        "moved Main/Mission/Patrol/Look -> Main/Mission/Patrol/Not/Look",
    ]


def test_a_node_that_was_taken_out_of_a_removed_one_has_moved():
    old = after(("<Look/>", '<Inverter name="Not"><Look/></Inverter>'))
    assert said(old, TREE) == [
        "removed Main/Mission/Patrol/Not <Inverter>",
        "moved Main/Mission/Patrol/Not/Look -> Main/Mission/Patrol/Look",
    ]


def test_a_node_may_move_to_another_parent_and_change():
    new = after(
        ('<Say name="Report" message="found" times="2"/>', ""),
        ("<Rest/>", '<Rest/><Say name="Report" message="lost"/>'),
    )
    assert said(TREE, new) == [
        "moved Main/Mission/Patrol/Report -> Main/Mission/Home/Report",
        'changed Main/Mission/Home/Report: message "found" -> "lost"',
        'changed Main/Mission/Home/Report: times "2" -> not written',
    ]


def test_of_two_that_changed_places_one_has_moved():
    new = after(('<Drive goal="home"/>\n    <Rest/>', '<Rest/>\n    <Drive goal="home"/>'))
    assert said(TREE, new) == ["moved Main/Mission/Home/Drive: child 1 -> child 2"]


def test_a_tree_that_is_gone_is_one_change():
    whole = document(TREE).replace("</root>", '<BehaviorTree ID="Spare"><Rest/></BehaviorTree></root>')
    text = difference_as_text(differences(whole, document(TREE)))
    assert text == "removed  Spare <BehaviorTree>, with 1 node in it  (a.xml:18)\n"


def test_another_main_tree_is_a_change_of_the_root():
    lines = difference_as_text(
        differences('<root main_tree_to_execute="A"/>', '<root main_tree_to_execute="B"/>')
    )
    assert lines == 'changed  root: main_tree_to_execute "A" -> "B"  (a.xml:1, b.xml:1)\n'


def test_a_description_of_a_port_can_change():
    model = '<root><TreeNodesModel><Action ID="Say"><input_port name="m">{}</input_port></Action></TreeNodesModel></root>'
    lines = difference_as_text(differences(model.format("What."), model.format("Which.")))
    assert lines.startswith('changed  TreeNodesModel/Say/m: description "What." -> "Which."')


def test_a_change_tells_the_line_in_both_files():
    found = differences(document(TREE), "\n" + document(after(('goal="home"', 'goal="base"'))))
    assert difference_as_text(found) == (
        'changed  Main/Mission/Home/Drive: goal "home" -> "base"  (a.xml:12, b.xml:13)\n'
    )


def flat(leaves):
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
def test_ten_thousand_nodes_are_compared_whatever_has_happened_to_them(old, new, changes):
    assert len(differences(flat(old), flat(new))) == changes


@given(tree_files())
def test_no_tree_differs_from_itself(tree_file):
    assert difference(tree_file, tree_file) == []


@given(tree_files(), tree_files())
def test_two_trees_differ_just_if_they_say_different_things(old, new):
    found = difference(old, new)
    assert bool(found) == bool(difference(new, old))
    if old.root == new.root:
        assert found == []
    for one in found:
        assert (one.old is None) == (one.change is Change.ADDED)
        assert (one.new is None) == (one.change is Change.REMOVED)


LISTS = st.lists(st.sampled_from("abcd"), max_size=9)


@given(LISTS, LISTS)
def test_what_two_lists_have_in_common_is_as_long_as_it_can_be(old, new):
    pairs = common_subsequence(old, new)
    assert all(old[i] == new[j] for i, j in pairs)
    assert all(i < k and j < m for (i, j), (k, m) in itertools.pairwise(pairs))
    assert len(pairs) == longest(old, new)


def longest(old, new):
    lengths = [0] * (len(new) + 1)
    for one in old:
        before = lengths[:]
        for j, other in enumerate(new):
            lengths[j + 1] = before[j] + 1 if one == other else max(before[j + 1], lengths[j])
    return lengths[-1]
