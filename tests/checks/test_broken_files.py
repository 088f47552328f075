"""Tests that a malformed file is checked up to its syntax error, and that all findings are reported at once."""

import pytest

from sar_compiler.cli.compile import main
from sar_compiler.loaded_tree import load

HEAD = '<root BTCPP_format="4" main_tree_to_execute="Main">\n<BehaviorTree ID="Main">\n'
# Each: the text of the tree up to the end of the file (its first line is line 3), and all findings.
IN_XML = {
    "mistakes before, and nothing that the rest may mend": (
        '<Sequence memroy="true">\n<Sucess/>\n<Sleep msec="5 s"/>\n<Inverter/>\n<Retry num_failures="x">\n<A b/>',
        [
            ("unknown-attribute", 3, "memory"),
            ("unknown-node", 4, "Success"),
            ("wrong-value", 5, "5s"),
            ("missing-child", 6, None),
            ("wrong-value", 7, None),
            ("malformed-xml", 8, None),
        ],
    ),
    "no mistake before": (
        '<Sequence>\n<SubTree ID="Later"/>\n<Inverter>\n<NotifyBase detect_node="Later"/>\n<ScriptCondition code="later"/>\n<A b=',
        [("malformed-xml", 8, None)],
    ),
    "a tag that lacks its slash": (
        "<Sequence>\n<Success>\n<Failure/>\n<Inverter>\n<Success/>\n<Failure/>\n</Sequence>",
        [("malformed-xml", 9, None)],
    ),
    "a control that is not over": (
        '<Parallel policy="SuccessOnSelected" selected="later">\n<Success/>\n<Parallel success_count="2">\n<Success/>\n<!--',
        [("malformed-xml", 7, None)],
    ),
    "nodes that a later model may describe": (
        "<Sequence>\n<MyLeaf/>\n</Sequence></BehaviorTree>\n<TreeNodesModel><Action ID='MyLeaf'></TreeNodesModel>",
        [("malformed-xml", 6, None)],
    ),
    "what is recovered, beside what cannot be": (
        '<Sequence>\n<ScriptCondition code="@a && @b and 1"/>\n<Success/></Sequense>',
        [("loose-xml", 4, "&amp;&amp;"), ("script-error", 4, "&&"), ("malformed-xml", 5, None)],
    ),
    "a mistake that is allowed": (
        "<Sequence>\n<!-- sar: allow loose-xml: it has always been so -->\n<ScriptCondition code='@a < 2'/><A",
        [("malformed-xml", 5, None)],
    ),
}
IN_YAML = {
    "mistakes before, and nothing that the rest may mend": (
        (
            "      - Sequence:\n          memroy: true\n          children:\n          - Sucess\n          - Inverter\n"
            "          - SubTree: {ID: Later}\n          - Sleep: {msec: 5 s}\n          - Sleep:\n              name: 'a\n"
        ),
        [
            ("unknown-attribute", 7, "memory"),
            ("unknown-node", 9, "Success"),
            ("missing-child", 10, None),
            ("wrong-value", 12, "5s"),
            ("malformed-yaml", 14, None),
        ],
    ),
    "a wrong shape, and a mistake behind it": (
        "      - Sequence:\n          children:\n          - Sleep: *a\n          - Timeout: {msec: [1]}\n          - Sucess\n",
        [("yaml-anchor", 8, None), ("wrong-shape", 9, None), ("unknown-node", 10, "Success")],
    ),
    "an attribute that comes too late": (
        "      - Sequence:\n          children:\n          - Sleep:\n              name: a\n              @",
        [("malformed-yaml", 10, None)],
    ),
}
YAML_HEAD = "root:\n  children:\n  - BehaviorTree:\n      ID: Main\n      children:\n"


def findings_in(path):
    return [(each.code, each.span.line, each.suggestion) for each in load(path).check()]


@pytest.mark.parametrize("name", IN_XML)
def test_xml_before_syntax_error_is_checked(name, tmp_path):
    text, expected = IN_XML[name]
    path = tmp_path / "tree.xml"
    path.write_text(HEAD + text, encoding="utf-8")
    assert findings_in(path) == expected


@pytest.mark.parametrize("name", IN_YAML)
def test_yaml_before_syntax_error_is_checked(name, tmp_path):
    text, expected = IN_YAML[name]
    path = tmp_path / "tree.yaml"
    path.write_text(YAML_HEAD + text, encoding="utf-8")
    assert findings_in(path) == expected


def test_nodes_of_included_file_are_known_before_syntax_error(tmp_path):
    (tmp_path / "palette.xml").write_text(
        '<root><TreeNodesModel><Action ID="MyLeaf"/></TreeNodesModel></root>'
    )
    path = tmp_path / "tree.xml"
    path.write_text(
        '<root>\n<include path="palette.xml"/><BehaviorTree ID="A"><Sequence>\n<MyLeaf/><MyLeef/><A'
    )
    assert findings_in(path) == [("unknown-node", 3, "MyLeaf"), ("malformed-xml", 3, None)]


LOOSE = HEAD + '<ScriptCondition code="@a < 2 &amp;&amp; @b && 1 == 1"/>\n</BehaviorTree>\n</root>\n'


def test_file_with_raw_characters_is_valid_and_can_be_shown_and_simulated(tmp_path, capsys):
    path = tmp_path / "tree.xml"
    path.write_text(LOOSE)
    assert main(["validate", str(path)]) == 0
    assert capsys.readouterr().out.count("warning[loose-xml]") == 2
    assert main(["validate", "--strict", str(path)]) == 1
    assert main(["show", str(path)]) == 0
    assert load(path).simulate(scenario={"facts": {}}) is not None


def test_fix_changes_only_raw_characters(tmp_path, capsys):
    path = tmp_path / "tree.xml"
    path.write_text(LOOSE)
    assert main(["validate", "--fix", str(path)]) == 0
    mended = LOOSE.replace("@a < 2", "@a &lt; 2").replace("@b && 1", "@b &amp;&amp; 1")
    assert path.read_text() == mended
    assert "loose-xml]: && -> &amp;&amp;" in capsys.readouterr().out


def test_script_and_raw_characters_are_fixed_in_malformed_file(tmp_path):
    path = tmp_path / "tree.xml"
    path.write_text(HEAD + "<Sequence><ScriptCondition code='@a < 2 and @b'/><A b")
    assert main(["validate", "--fix", str(path)]) == 1
    assert "code='@a &lt; 2 &amp;&amp; @b'" in path.read_text()
