"""Tests of drawings of trees as SVG, Mermaid and Graphviz."""

import itertools
import random
import re
from xml.sax.saxutils import escape

import pydot
import pytest
from lxml import etree

from sar_compiler.compiler import bind_main, preview_tree
from sar_compiler.nodes.registry import default_registry
from sar_compiler.testing import compile_for_test
from sar_compiler.views.drawing import (
    _NARROW,
    Shape,
    _place_blocks,
    dot,
    drawn_nodes,
    mermaid,
    svg,
    too_large,
)
from sar_compiler.views.run_tree import describe_tree
from tests.trees import document, forest_of

SVG = "{http://www.w3.org/2000/svg}"
SHIPPED = ("search_and_rescue", "search_and_rescue_resilient", "search_and_rescue_guarded")


def tree(*trees):
    """Compile trees for display; the first one is the main tree."""
    bodies = [f'<BehaviorTree ID="{name}">{body}</BehaviorTree>' for name, body in trees]
    text = f'<root BTCPP_format="4" main_tree_to_execute="{trees[0][0]}">{"".join(bodies)}</root>'
    return preview_tree(bind_main(forest_of(text), default_registry()))


def tree_of(body):
    return preview_tree(bind_main(forest_of(document(body)), default_registry()))


def leaf_tree(name):
    return tree_of(f'<AlwaysSuccess name="{name}"/>')


def random_tree_xml(count, chance):
    """Return the XML of a random tree with `count` nodes."""
    if count == 1:
        return f'<AlwaysSuccess name="Leaf{chance.randrange(10**9)}"/>'
    sizes: list[int] = []
    while sum(sizes) < count - 1:
        sizes.append(chance.randint(1, count - 1 - sum(sizes)))
    tag = "Inverter" if len(sizes) == 1 else chance.choice(("Sequence", "Fallback", "ParallelAll"))
    return f"<{tag}>{''.join(random_tree_xml(size, chance) for size in sizes)}</{tag}>"


def parse_svg(drawing):
    return etree.fromstring(drawing.encode())


def parse_dot(text):
    """Return the graph as parsed by pydot, which implements Graphviz's grammar."""
    graphs = pydot.graph_from_dot_data(text)
    assert graphs
    assert len(graphs) == 1
    return graphs[0]


def labels(drawing):
    """Return the texts in each node of an SVG."""
    groups = parse_svg(drawing).findall(f"{SVG}g")
    return [[text.text for text in group.findall(f"{SVG}text")] for group in groups]


def boxes(nodes):
    """Return the edges of each node's box: left, right, top, bottom."""
    return [
        (each.x + each.shift, each.x + each.shift + each.wide, each.top, each.bottom)
        for each in _place_blocks(nodes)
    ]


@pytest.mark.parametrize(
    ("body", "shape", "label", "details"),
    [
        ("<Sequence><AlwaysSuccess/></Sequence>", Shape.SEQUENCE, "→ Sequence", ""),
        ('<Sequence name="A" memory="false"><AlwaysSuccess/></Sequence>', Shape.SEQUENCE, "→R A", ""),
        ('<Fallback name="A"><AlwaysSuccess/></Fallback>', Shape.SELECTOR, "? A", ""),
        (
            '<ReactiveFallback name="A"><AlwaysSuccess/></ReactiveFallback>',
            Shape.SELECTOR,
            "?R A",
            "",
        ),
        (
            '<SequenceWithMemory name="A"><AlwaysSuccess/></SequenceWithMemory>',
            Shape.SEQUENCE,
            "→ A",
            "SequenceWithMemory",
        ),
        (
            '<Parallel name="A" success_count="1"><AlwaysSuccess/></Parallel>',
            Shape.PARALLEL,
            "⇉ A",
            "Parallel success_count=1",
        ),
        (
            "<IfThenElse><AlwaysSuccess/><AlwaysSuccess/></IfThenElse>",
            Shape.CONTROL,
            "◆ IfThenElse",
            "",
        ),
        (
            '<Repeat num_cycles="3"><AlwaysSuccess/></Repeat>',
            Shape.DECORATOR,
            "↻ Repeat",
            "num_cycles=3",
        ),
        ("<Inverter><AlwaysSuccess/></Inverter>", Shape.DECORATOR, "◇ Inverter", ""),
        (
            '<ScriptCondition name="Low?" code="battery &lt; 3"/>',
            Shape.CONDITION,
            "Low?",
            "ScriptCondition code='battery < 3'",
        ),
        ('<Sleep name="Pause" msec="5"/>', Shape.ACTION, "Pause", "Sleep msec=5"),
    ],
)
def test_node_is_drawn_with_symbol_name_and_attributes(body, shape, label, details):
    node = drawn_nodes(tree_of(f"<Sequence><Script code='battery := 1'/>{body}</Sequence>"))[2]
    assert (node.shape, node.label, node.details) == (shape, label, details)


def test_decorators_from_attributes_are_drawn():
    around, inside, node = drawn_nodes(
        tree_of('<Sleep name="Pause" msec="5" oneshot="ON_COMPLETION" _failureIf="true"/>')
    )
    assert (around.shape, around.label, around.details) == (
        Shape.DECORATOR,
        "◇ PauseOneShot",
        "policy=ON_COMPLETION",
    )
    assert (inside.label, inside.details) == ("◇ PauseConditions", "_failureIf=true")
    assert (node.shape, node.label, node.details) == (Shape.ACTION, "Pause", "Sleep msec=5")


def test_node_title_names_file_and_line():
    nodes = drawn_nodes(compile_for_test("trees/search_and_rescue.xml"))
    assert nodes[1].title == "trees/search_and_rescue.xml:13 <Sequence> Patrol"


def test_folded_subtree_is_one_node_without_frame():
    drawn = tree(
        ("Main", '<Sequence><SubTree ID="Inner" name="Here"/><AlwaysFailure/></Sequence>'),
        ("Inner", '<Sequence><SubTree ID="Deeper"/></Sequence>'),
        ("Deeper", "<AlwaysSuccess/>"),
    )
    nodes = drawn_nodes(drawn, folded=True)
    assert [(each.name, each.parent, each.children, each.end) for each in nodes] == [
        ("Sequence", -1, (1, 2), 3),
        ("Here", 0, (), 2),
        ("AlwaysFailure", 0, (), 3),
    ]
    assert [each for each in parse_svg(svg(drawn, folded=True)) if each.get("class") == "frame"] == []
    assert "subgraph" not in dot(drawn, folded=True)
    assert "subgraph" not in mermaid(drawn, folded=True)


def test_subtree_has_frame_around_its_nodes():
    drawn = tree(
        ("Main", '<Sequence><SubTree ID="Inner" name="Here"/><AlwaysFailure/></Sequence>'),
        ("Inner", "<Sequence><AlwaysSuccess/></Sequence>"),
    )
    assert [(each.is_subtree, each.end) for each in drawn_nodes(drawn)][1] == (True, 4)
    (frame,) = (each for each in parse_svg(svg(drawn)) if each.get("class") == "frame")
    left, top, wide, high = (float(frame.attrib[name]) for name in ("x", "y", "width", "height"))
    inside = [
        left < west and east < left + wide and top < north and south < top + high
        for west, east, north, south in boxes(drawn_nodes(drawn))
    ]
    assert inside == [False, True, True, True, False]
    graph = parse_dot(dot(drawn))
    (cluster,) = graph.get_subgraphs()
    assert [node.get_name() for node in cluster.get_nodes()] == ["n1", "n2", "n3"]


@pytest.mark.parametrize("seed", range(20))
def test_boxes_neither_overlap_nor_leave_picture(seed):
    nodes = drawn_nodes(tree_of(random_tree_xml(150, random.Random(seed))))  # noqa: S311 - the same trees in every run
    block, places = _place_blocks(nodes)[0], boxes(nodes)
    for left, right, top, bottom in places:
        assert block.x <= left < right <= block.x + block.width
        assert block.y <= top < bottom <= block.y + block.height
    for one, other in itertools.combinations(places, 2):
        assert one[1] <= other[0] or other[1] <= one[0] or one[3] <= other[2] or other[3] <= one[2]


def test_children_are_side_by_side_if_they_fit():
    _, first, second = boxes(drawn_nodes(tree_of("<Sequence><AlwaysSuccess/><AlwaysFailure/></Sequence>")))
    assert first[2] == second[2]
    assert first[1] < second[0]


def test_many_children_are_stacked_vertically():
    nodes = drawn_nodes(tree_of(f"<Sequence>{'<AlwaysSuccess/>' * 30}</Sequence>"))
    first, second = boxes(nodes)[1:3]
    assert first[0] == second[0]
    assert first[3] < second[2]
    assert _place_blocks(nodes)[0].width <= _NARROW


def test_picture_of_thousand_nodes_is_not_a_thin_strip():
    block = _place_blocks(drawn_nodes(tree_of(random_tree_xml(1000, random.Random(1)))))[0]  # noqa: S311 - the same in every run
    assert block.height < 20 * block.width


def test_deep_tree_is_drawn():
    body = "<Inverter>" * 190 + "<AlwaysSuccess/>" + "</Inverter>" * 190
    drawn = tree_of(body)
    assert len(labels(svg(drawn))) == 191
    assert mermaid(drawn).count("-->") == dot(drawn).count("->") == 190


@pytest.mark.parametrize("name", SHIPPED)
def test_every_format_contains_every_node_of_shipped_tree(name):
    drawn = compile_for_test(name)
    nodes = drawn_nodes(drawn)
    assert labels(svg(drawn)) == [[text for text in (each.label, each.details) if text] for each in nodes]
    edges = {(each.parent, number) for number, each in enumerate(nodes) if each.parent >= 0}
    assert {tuple(map(int, found)) for found in re.findall(r"n(\d+) --> n(\d+)", mermaid(drawn))} == edges
    graph = parse_dot(dot(drawn))
    assert {(str(each.get_source()), str(each.get_destination())) for each in graph.get_edges()} == {
        (f"n{parent}", f"n{child}") for parent, child in edges
    }


ODD = ("<script>alert(1)</script>", """a "b" 'c'""", "&amp; #35; ]]>", "`a` *b* _c_ \\n", "%%{a}%% $$b$$ -->")


@pytest.mark.parametrize("name", ODD)
def test_special_characters_in_name_are_text_in_svg(name):
    drawing = svg(leaf_tree(escape(name, {'"': "&quot;"})))
    assert labels(drawing)[0][0] == name
    tags = [each.tag.removeprefix(SVG) for each in parse_svg(drawing).iter()]
    assert tags == ["svg", "title", "style", "rect", "path", "g", "title", "path", "text", "text"]


def test_special_characters_in_name_are_text_in_dot():
    text = dot(leaf_tree("a &quot;b&quot; \\n &amp;lt;c"))
    assert 'label="a \\"b\\" \\\\n &amp;lt;c\\nAlwaysSuccess"' in text
    assert parse_dot(text).get_node("n0")


@pytest.mark.parametrize("name", ODD)
def test_special_characters_in_name_are_escaped_in_mermaid(name):
    drawn = mermaid(leaf_tree(escape(name, {'"': "&quot;"})))
    found = re.fullmatch(r'flowchart TD\n  n0\["(.*)<br>AlwaysSuccess"\]:::action\n  classDef .*\n', drawn)
    assert found
    assert re.fullmatch(r"(\w|[ /]|#\d+;)+", found[1])
    assert re.sub(r"#(\d+);", lambda match: chr(int(match[1])), found[1]).replace("\u200b", "") == name


@pytest.mark.parametrize(
    ("name", "written"),
    [("1. a", "1#46; a"), ("num_a=3", "num_a=3"), ("a\\nb", "a#92;#8203;nb"), ("fa:fa", "fa#58;#8203;fa")],
)
def test_list_line_break_and_icon_syntax_is_escaped_in_mermaid(name, written):
    assert f'["{written}<br>' in mermaid(leaf_tree(name))


def test_control_and_bidi_characters_in_name_are_escaped():
    drawn = leaf_tree("a&#x202e;b")
    drawn.root.name = "a\u202eb\x1b\uffff\nc"
    for view in (svg, mermaid, dot):
        text = view(drawn)
        assert "\u202e" not in text
        assert "\x1b" not in text
    parse_svg(svg(drawn))


@pytest.mark.parametrize("sign", ["\u202e", "\x9b", "\n"])
def test_control_and_bidi_characters_in_tree_id_are_escaped(sign):
    drawn = tree((f"a&#{ord(sign)};b", "<AlwaysSuccess/>"))
    assert drawn.instance.tree.name == f"a{sign}b"
    for view in (svg, mermaid, dot):
        assert f"a{sign}b" not in view(drawn)


def test_long_text_is_cut_in_box_and_complete_in_title():
    value = "x" * 100
    node = drawn_nodes(tree_of(f'<Script code="{value} := 1"/>'))[0]
    assert node.details.endswith("…")
    assert len(node.details) == 40
    assert value in node.title


def test_box_width_follows_display_width_of_text():
    widths = [
        right - left
        for left, right, *_ in (
            boxes(drawn_nodes(leaf_tree(name * 12)))[0] for name in ("語", "ab", "a\u0301b")
        )
    ]
    assert widths[0] == widths[1] == widths[2]


def test_flowchart_too_large_for_github_is_detected():
    assert not too_large(mermaid(compile_for_test("search_and_rescue_guarded")))
    assert not too_large(mermaid(tree_of(f"<Sequence>{'<AlwaysSuccess/>' * 499}</Sequence>")))
    assert too_large(mermaid(tree_of(f"<Sequence>{'<AlwaysSuccess/>' * 500}</Sequence>")))


def test_small_tree_as_mermaid():
    assert (
        mermaid(tree_of('<Sequence name="All"><AlwaysSuccess/><Sleep msec="5"/></Sequence>'))
        == """\
flowchart TD
  n0["→ All"]:::sequence
  n1["AlwaysSuccess"]:::action
  n2["Sleep<br>msec=5"]:::action
  n0 --> n1
  n0 --> n2
  classDef sequence fill:#ffd9a0,stroke:#5b6470,color:#16191d
  classDef action fill:#e4e6e9,stroke:#5b6470,color:#16191d
"""
    )


def test_small_tree_as_dot():
    assert (
        dot(tree_of('<Sequence name="All"><Sleep msec="5"/></Sequence>'))
        == """\
digraph "Main" {
  ordering=out;
  graph [fontname="sans-serif", style=dashed];
  node [fontname="sans-serif", fontsize=9, style=filled];
  n0 [label="→ All", shape=box, fillcolor="#ffd9a0", tooltip="test.xml:3 <Sequence> All"];
  n1 [label="Sleep\\nmsec=5", shape=ellipse, fillcolor="#e4e6e9", tooltip="test.xml:3 <Sleep> Sleep msec=5"];
  n0 -> n1;
}
"""
    )


def test_description_for_journal_contains_shape_and_sign_of_each_node():
    _, of_run = describe_tree(tree_of("<Sequence><AlwaysSuccess/></Sequence>"))
    assert of_run["looks"] == [["sequence", "→"], ["action", ""]]
