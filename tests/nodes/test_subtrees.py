"""Tests of subtrees: `SubTree` elements, nesting and its limits, and references between trees."""

import re

import pytest

from sar_compiler.checks import check
from sar_compiler.compiler import bind_main, preview_tree
from sar_compiler.nodes.binding import nesting
from sar_compiler.nodes.binding.nesting import MAX_LEVELS, MAX_NODES
from sar_compiler.nodes.registry import default_registry
from sar_compiler.runtime.kernel.cells import FAILURE, SUCCESS
from sar_compiler.runtime.kernel.live import LiveTree
from sar_compiler.tree.discovery import read_tree_file
from sar_compiler.tree.forest import load_forest
from tests.trees import forest_of

REGISTRY = default_registry()


def tree(name, body):
    return f'<BehaviorTree ID="{name}">{body}</BehaviorTree>'


def file(*trees, main="Main"):
    """Return a file with its trees in lines 2, 3 and so on."""
    return f'<root BTCPP_format="4" main_tree_to_execute="{main}">\n' + "\n".join(trees) + "\n</root>"


def locate_findings(*trees):
    return [
        (f.code, f.span.line, f.span.column, f.suggestion) for f in check(forest_of(file(*trees)), REGISTRY)
    ]


def column(line, part):
    return line.index(part) + 1


def test_tree_may_be_used_several_times():
    assert (
        locate_findings(
            tree("Main", '<Sequence><SubTree ID="B"/><SubTree ID="B"/></Sequence>'), tree("B", "<Success/>")
        )
        == []
    )


def test_subtree_is_named_by_its_name_attribute_or_id():
    text = file(
        tree("Main", '<Sequence><SubTree ID="B" name="first"/><SubTree ID="B"/></Sequence>'),
        tree("B", "<Success/>"),
    )
    root = preview_tree(bind_main(forest_of(text), REGISTRY)).root
    assert [child.name for child in root.children] == ["first", "B"]


def test_unknown_tree_is_reported_with_nearest_name():
    line = tree("Main", '<SubTree ID="Partol"/>')
    assert locate_findings(line, tree("Patrol", "<Success/>")) == [
        ("unknown-tree", 2, column(line, "Partol"), "Patrol")
    ]


@pytest.mark.parametrize("attributes", ["", ' ID=""'])
def test_subtree_without_id_is_reported(attributes):
    line = tree("Main", f"<SubTree{attributes}/>")
    place = '"/>' if attributes else "<SubTree"
    assert locate_findings(line) == [("missing-attribute", 2, column(line, place), None)]


def test_children_of_subtree_element_are_reported():
    line = tree("Main", '<SubTree ID="B"><Success/></SubTree>')
    assert locate_findings(line, tree("B", "<Success/>")) == [
        ("child-of-leaf", 2, column(line, "<Success"), None)
    ]


def test_unknown_attribute_with_underscore_is_reported():
    line = tree("Main", '<SubTree ID="B" _autoremp="true"/>')
    assert locate_findings(line, tree("B", "<Success/>")) == [
        ("unknown-attribute", 2, column(line, "_autoremp"), "_autoremap")
    ]


def test_autoremap_must_be_true_or_false():
    line = tree("Main", '<SubTree ID="B" _autoremap="ture"/>')
    assert locate_findings(line, tree("B", "<Success/>")) == [
        ("wrong-value", 2, column(line, "ture"), "true")
    ]


def test_two_trees_may_contain_nodes_with_same_name():
    inner = tree("B", '<SubTree ID="C" name="c"/>')
    assert (
        locate_findings(
            tree("Main", '<Sequence><SubTree ID="C" name="c"/><SubTree ID="B"/></Sequence>'),
            inner,
            tree("C", "<Success/>"),
        )
        == []
    )


@pytest.mark.parametrize(
    ("trees", "lines"),
    [
        ([tree("Main", '<SubTree ID="Main"/>')], [2]),
        ([tree("Main", '<SubTree ID="B"/>'), tree("B", '<SubTree ID="Main"/>')], [3]),
        (
            [
                tree("Main", '<SubTree ID="B"/>'),
                tree("B", '<SubTree ID="C"/>'),
                tree("C", '<SubTree ID="B"/>'),
            ],
            [4],
        ),
        ([tree("Main", "<Success/>"), tree("B", '<SubTree ID="B"/>')], [3]),
    ],
)
def test_recursive_trees_are_reported_once_where_cycle_closes(trees, lines):
    assert [(code, line) for code, line, *_ in locate_findings(*trees)] == [
        ("recursive-tree", line) for line in lines
    ]


def test_message_about_cycle_lists_its_trees():
    text = file(
        tree("Main", '<SubTree ID="B"/>'), tree("B", '<SubTree ID="C"/>'), tree("C", '<SubTree ID="B"/>')
    )
    (finding,) = check(forest_of(text), REGISTRY)
    assert finding.message == "these trees contain each other: B -> C -> B"


def test_message_about_long_cycle_is_abbreviated():
    trees = [tree(f"T{number}", f'<SubTree ID="T{(number + 1) % 20}"/>') for number in range(20)]
    (finding,) = check(forest_of(file(*trees, main="T0")), REGISTRY)
    assert finding.message.endswith("T0 -> T1 -> T2 -> T3 -> ... -> T17 -> T18 -> T19 -> T0")


def chain(count):
    """Return trees of two levels each, nested in each other."""
    trees = [
        tree(f"T{number}", f'<Inverter><SubTree ID="T{number + 1}"/></Inverter>') for number in range(count)
    ]
    return [*trees, tree(f"T{count}", "<Success/>")]


def test_trees_nested_up_to_limit_can_be_ticked():
    text = file(*chain((MAX_LEVELS - 1) // 2), main="T0")
    assert check(forest_of(text), REGISTRY) == []
    live = LiveTree(preview_tree(bind_main(forest_of(text), REGISTRY)).root)
    assert live.tick() in (SUCCESS, FAILURE)
    live.stop()


@pytest.mark.parametrize("count", [MAX_LEVELS // 2, 5000])
def test_too_deep_nesting_is_reported_once_where_limit_is_exceeded(count):
    (finding,) = check(forest_of(file(*chain(count), main="T0")), REGISTRY)
    assert (finding.code, finding.span.line) == ("too-deep", 2 + MAX_LEVELS // 2)
    assert f"{2 * count + 1} levels" in finding.message
    assert str(MAX_LEVELS) in (finding.hint or "")


def test_conditions_and_oneshot_count_as_levels():
    def nested(deep, leaf):
        return '<Inverter _onSuccess="a := 1" oneshot="ON_COMPLETION">' * deep + leaf + "</Inverter>" * deep

    assert 150 * 3 + 50 * 3 + 2 > MAX_LEVELS > 150 + 50 + 2
    trees = tree("Main", nested(150, '<SubTree ID="Inner"/>')), tree("Inner", nested(50, "<Success/>"))
    assert [code for code, *_ in locate_findings(*trees)] == ["too-deep"]


def doubling(count):
    body = '<Sequence><SubTree ID="T{0}"/><SubTree ID="T{0}"/></Sequence>'
    return [*(tree(f"T{n}", body.format(n + 1)) for n in range(count)), tree(f"T{count}", "<Success/>")]


def test_exponentially_growing_trees_are_rejected_before_they_are_built():
    (finding,) = check(forest_of(file(*doubling(60), main="T0")), REGISTRY)
    assert (finding.code, finding.span.line) == ("too-many-nodes", 2)
    assert f"{MAX_NODES:,}" in finding.message


def test_total_number_of_nodes_of_all_trees_is_limited(monkeypatch):
    monkeypatch.setattr(nesting, "MAX_NODES", 20)
    users = [tree(f"U{number}", '<SubTree ID="T0"/>') for number in range(3)]
    assert [
        (code, line) for code, line, *_ in locate_findings(*doubling(2), *users, tree("Main", "<Success/>"))
    ] == [
        ("too-many-nodes", 6),
        ("too-many-nodes", 7),
    ]


def test_error_in_reused_tree_is_reported_once():
    body = (
        '<Sequence><SubTree ID="B" name="1"/><SubTree ID="B" name="2"/><SubTree ID="B" name="3"/></Sequence>'
    )
    assert [code for code, *_ in locate_findings(tree("Main", body), tree("B", "<NotifyBase/>"))] == [
        "missing-reference"
    ]


DETECT = '<DetectSurvivor name="eye"/>'


@pytest.mark.parametrize(
    "trees",
    [
        [tree("Main", f'<Sequence>{DETECT}<SubTree ID="B"/></Sequence>'), tree("B", "<NotifyBase/>")],
        [
            tree("Main", f'<Sequence>{DETECT}<SubTree ID="B"/></Sequence>'),
            tree("B", '<SubTree ID="C"/>'),
            tree("C", '<NotifyBase detect_node="eye"/>'),
        ],
    ],
)
def test_reference_can_resolve_to_node_of_outer_tree(trees):
    assert locate_findings(*trees) == []
    tree_ = preview_tree(bind_main(forest_of(file(*trees)), REGISTRY))
    nodes = {node.name: node for node in tree_.root.iterate()}
    assert tree_.origins[nodes["NotifyBase"].id].attributes["detect_node"] == "eye"
    assert vars(nodes["NotifyBase"])["detect_node"] is nodes["eye"]


def test_node_of_same_tree_takes_precedence_over_outer_trees():
    main = tree("Main", f'<Sequence>{DETECT}<SubTree ID="B"/></Sequence>')
    inner = tree("B", '<Sequence><DetectSurvivor name="near"/><NotifyBase/></Sequence>')
    root = preview_tree(bind_main(forest_of(file(main, inner)), REGISTRY)).root
    nodes = {node.name: node for node in root.iterate()}
    assert vars(nodes["NotifyBase"])["detect_node"] is nodes["near"]


def test_each_instance_of_tree_references_its_own_nodes():
    main = tree("Main", '<Sequence><SubTree ID="B" name="1"/><SubTree ID="B" name="2"/></Sequence>')
    inner = tree("B", "<Sequence><DetectSurvivor/><NotifyBase/></Sequence>")
    root = preview_tree(bind_main(forest_of(file(main, inner)), REGISTRY)).root
    referred = [vars(node)["detect_node"] for node in root.iterate() if node.name == "NotifyBase"]
    assert referred[0] is not referred[1]


def test_node_of_sibling_subtree_cannot_be_referenced():
    body = '<Sequence><SubTree ID="B"/><NotifyBase detect_node="eye"/></Sequence>'
    line = tree("Main", body)
    assert locate_findings(line, tree("B", DETECT)) == [
        ("unknown-reference", 2, column(line, 'eye"/>'), None)
    ]


def test_main_tree_must_contain_all_referenced_nodes():
    user = tree("User", f'<Sequence>{DETECT}<SubTree ID="Main"/></Sequence>')
    assert [(code, line) for code, line, *_ in locate_findings(tree("Main", "<NotifyBase/>"), user)] == [
        ("missing-reference", 2)
    ]


def test_ambiguous_reference_to_outer_tree_lists_lines():
    text = file(
        tree("Main", f'<Sequence>{DETECT}<DetectSurvivor/><SubTree ID="B"/></Sequence>'),
        tree("B", "<NotifyBase/>"),
    )
    (finding,) = check(forest_of(text), REGISTRY)
    assert (finding.code, finding.span.line) == ("ambiguous-reference", 3)
    assert "(lines 2, 2)" in finding.message


def test_ambiguous_reference_lists_only_first_candidates():
    body = "<Sequence>" + DETECT * 30 + "<NotifyBase/></Sequence>"
    (finding,) = check(forest_of(file(tree("Main", body))), REGISTRY)
    assert "30 DetectSurvivor nodes (lines 2, 2, 2, 2, 2, 2, 2, 2, 2, 2 and 20 more)" in finding.message


def test_ambiguous_reference_to_tree_of_other_file_names_file(tmp_path):
    (tmp_path / "part.xml").write_text(
        file(tree("B", "<NotifyBase/>")).replace(' main_tree_to_execute="Main"', "")
    )
    main = tree(
        "Main", f'<Sequence>{DETECT}<DetectSurvivor/><SubTree ID="B"/></Sequence><!-- --></BehaviorTree>'
    )
    (tmp_path / "main.xml").write_text(
        file('<include path="part.xml"/>', main.removesuffix("</BehaviorTree>"))
    )
    (finding,) = check(load_forest(tmp_path / "main.xml", read_tree_file), REGISTRY)
    assert finding.source.path.endswith("part.xml")
    assert re.search(r"\(lines 3, 3 of .*main\.xml\)", finding.message)


def test_tree_may_have_maximum_number_of_nodes(monkeypatch):
    monkeypatch.setattr(nesting, "MAX_NODES", 3)
    trees = [tree("Main", '<Sequence><Success name="a"/><Success name="b"/></Sequence>')]
    assert not bind_main(forest_of(file(*trees)), REGISTRY).findings
    assert locate_findings(*trees) == []
