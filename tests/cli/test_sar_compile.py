"""Tests of `sar-compile`: exit statuses and output of its commands."""

import json
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from sar_compiler.cli.compile import main
from sar_compiler.compiler.outline import add_tags, unicode_tree
from sar_compiler.testing import compile_for_test
from sar_compiler.views.findings import plain_text
from tests.cli.command_runner import run
from tests.trees import document

SHIPPED = "trees/search_and_rescue.xml"


@pytest.fixture
def invalid_tree(tmp_path):
    path = tmp_path / "broken.xml"
    path.write_text(document('<Selector>\n  <Sey message="hi"/>\n</Selector>'), encoding="utf-8")
    return str(path)


def test_valid_tree_has_status_0(capsys):
    assert run(capsys, "validate", SHIPPED) == (0, f"{SHIPPED}: no findings\n", "")


def test_findings_have_status_1_and_go_to_standard_output(capsys, invalid_tree):
    status, out, _ = run(capsys, "validate", invalid_tree)
    assert status == 1
    assert out.startswith(
        f"{invalid_tree}:4:3: error[unknown-node]: there is no node 'Sey'\n    4 |   <Sey message"
    )


def test_every_file_is_checked_despite_errors_in_others(capsys, invalid_tree, tmp_path):
    other = shutil.copy(invalid_tree, tmp_path / "other.xml")
    status, out, _ = run(capsys, "validate", "--all", invalid_tree, SHIPPED, str(other))
    assert status == 1
    assert out.count("unknown-node") == 2
    assert f"{SHIPPED}: no findings" in out


def test_missing_file_has_status_2_and_others_are_checked(capsys, invalid_tree):
    status, out, err = run(capsys, "validate", "nowhere.xml", invalid_tree)
    assert status == 2
    assert err.splitlines() == [
        "sar-compile: cannot read nowhere.xml: No such file or directory",
        "1 error in 1 file",
    ]
    assert "unknown-node" in out


@pytest.mark.parametrize("command", ["validate", "show"])
def test_unknown_tree_name_lists_shipped_trees(capsys, command):
    status, _, err = run(capsys, command, "search_and_rescu")
    assert status == 2
    assert err == (
        "sar-compile: there is no tree file 'search_and_rescu', nor a shipped tree of that name "
        "(shipped: failsafes, search_and_rescue, search_and_rescue_guarded, search_and_rescue_resilient, search_areas, search_areas_guarded, search_sweeps, search_sweeps_guarded); did you mean 'search_and_rescue'?\n"
    )


def test_other_files_are_checked_despite_unknown_tree_name(capsys):
    status, out, err = run(capsys, "validate", "nosuch", SHIPPED)
    assert (status, out) == (2, f"{SHIPPED}: no findings\n")
    assert "there is no tree file 'nosuch'" in err


def test_json_has_all_fields_of_finding(capsys, invalid_tree):
    status, out, _ = run(capsys, "validate", "--format", "json", invalid_tree, SHIPPED)
    assert status == 1
    assert json.loads(out) == [
        {
            "file": invalid_tree,
            "line": 4,
            "column": 3,
            "end_line": 4,
            "end_column": 7,
            "severity": "error",
            "code": "unknown-node",
            "message": "there is no node 'Sey'",
            "suggestion": None,
            "hint": "list the known nodes with sar-compile nodes, or add a module with --nodes or a palette with --model",
            "cause": "unknown-node: there are no nodes of these names",
        }
    ]


def test_json_of_valid_tree_is_empty_list(capsys):
    status, out, _ = run(capsys, "validate", "--format", "json", SHIPPED)
    assert (status, json.loads(out)) == (0, [])


def test_malformed_xml_is_finding_in_json(capsys, tmp_path):
    path = tmp_path / "cut.xml"
    path.write_text("<root>", encoding="utf-8")
    status, out, _ = run(capsys, "validate", "--format", "json", str(path))
    assert status == 1
    assert [(f["code"], f["line"], f["column"]) for f in json.loads(out)] == [("malformed-xml", 1, 7)]


@pytest.mark.parametrize(
    "arguments",
    [[], ["validate"], ["valdate", SHIPPED], ["validate", "--form", "json", SHIPPED], ["show", "a", "b"]],
)
def test_wrong_usage_has_status_2(capsys, arguments):
    with pytest.raises(SystemExit) as caught:
        main(arguments)
    assert caught.value.code == 2
    assert "usage: sar-compile" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("arguments", "meant"),
    [(["valdate", SHIPPED], "validate"), (["validate", SHIPPED, "--format", "jsn"], "json")],
)
def test_misspelt_word_on_command_line_gets_suggestion(capsys, arguments, meant):
    with pytest.raises(SystemExit):
        main(arguments)
    assert capsys.readouterr().err.endswith(f"; did you mean '{meant}'?\n")


def test_missing_command_lists_all_commands(capsys):
    with pytest.raises(SystemExit):
        main([])
    assert "Report all errors in tree files." in capsys.readouterr().err


def test_show_draws_compiled_tree(capsys):
    status, out, _ = run(capsys, "show", SHIPPED)
    assert status == 0
    assert out.splitlines()[:3] == [
        "[o] MissionOrReturnToBase",
        "    {-} Patrol",
        "        --> ZonesRemaining?",
    ]


def test_show_prints_compiled_tree_as_json(capsys):
    status, out, _ = run(capsys, "show", "--format", "json", SHIPPED)
    root = json.loads(out)
    assert status == 0
    assert (root["class"], root["memory"], root["line"]) == ("py_trees.composites.Selector", False, 11)
    assert root["children"][1]["policy"] == "ON_COMPLETION"
    assert "memory" not in root["children"][1]


def test_show_of_invalid_tree_prints_findings_on_standard_error(capsys, invalid_tree):
    status, out, err = run(capsys, "show", invalid_tree)
    assert (status, out) == (1, "{o} Selector\n    --> Sey  ?\n")
    assert "unknown-node" in err


def test_show_draws_tree_and_reports_findings_of_its_file(capsys, tmp_path):
    path = tmp_path / "format.xml"
    path.write_text(document("<Success/>").replace("BTCPP_format", "BTCPP_formt"), encoding="utf-8")
    status, out, err = run(capsys, "show", str(path))
    assert (status, out) == (1, "--> Success\n")
    assert "unknown-attribute" in err


def test_show_with_tree_id_needs_no_main_tree(capsys, tmp_path):
    path = tmp_path / "two.xml"
    tree = '<BehaviorTree ID="{}"><{}/></BehaviorTree>'
    path.write_text(
        f"<root>{tree.format('A', 'Success')}{tree.format('B', 'Failure')}</root>", encoding="utf-8"
    )
    assert run(capsys, "show", "--tree", "B", str(path))[:2] == (0, "--> Failure\n")


def test_show_with_unknown_tree_id_has_status_2(capsys):
    status, _, err = run(capsys, "show", "--tree", "Nope", SHIPPED)
    assert status == 2
    assert err == "sar-compile: there is no tree 'Nope' (known: SearchAndRescue)\n"


def test_nodes_lists_available_nodes(capsys):
    status, out, _ = run(capsys, "nodes")
    assert status == 0
    assert any(line.startswith("NavigateToZone ") and " action " in line for line in out.splitlines())


def test_nodes_describes_attributes_of_node(capsys):
    _, out, _ = run(capsys, "nodes", "NotifyBase")
    assert "detect_node: the name of a DetectSurvivor in the same tree" in out
    assert "timeout_sec: a duration (seconds, or a number with ms, s or min). default: 5.0" in out


def test_nodes_shows_direction_of_ports(capsys):
    _, out, _ = run(capsys, "nodes", "Hear", "--nodes", "tests.nodes.port_leaves")
    assert "  heard: output, takes a {key}; a string. required. What was heard.\n" in out
    assert "  anything: input and output; a value. required. Whatever it is.\n" in out
    assert "  volume: input; a number. optional. How loud.\n" in out


def test_nodes_prints_defaults_in_tree_file_syntax(capsys):
    _, out, _ = run(capsys, "nodes", "Hear", "--nodes", "tests.nodes.port_leaves")
    assert "numbers separated by ;. default: 0.5;1.0. " in out
    assert "default: 1.5. How long." in out
    assert "memory: true or false. default: true. " in run(capsys, "nodes", "Sequence")[1]
    assert "memory: true or false. always false. " in run(capsys, "nodes", "ReactiveSequence")[1]
    assert "synchronise: true or false. optional. " in run(capsys, "nodes", "Parallel")[1]


@pytest.mark.parametrize(
    ("tag", "skipped"),
    [
        ("Precondition", ['SKIPPED (with else="SKIPPED", or if its child is skipped)']),
        ("RunOnce", ['SKIPPED (with then_skip="true" as by default, or if its child is skipped)']),
        ("LoopInt", ['SKIPPED (with if_empty="SKIPPED")']),
        ("SkipUnlessUpdated", ["SKIPPED"]),
        ("Inverter", ["SKIPPED (if its child is skipped)"]),
        ("Fallback", ["SKIPPED (if its children are skipped)"]),
        ("EternalGuard", []),
    ],
)
def test_nodes_shows_when_node_is_skipped(capsys, tag, skipped):
    _, out, _ = run(capsys, "nodes", tag)
    assert f"outcomes: {', '.join(['FAILURE, RUNNING, SUCCESS', *skipped])}\n" in out
    assert json.loads(run(capsys, "nodes", tag, "--format", "json")[1])[0]["skipped"] == skipped


def test_nodes_does_not_print_python_none(capsys):
    _, out, _ = run(capsys, "nodes")
    tags = [line.split()[0] for line in out.splitlines()]
    assert [tag for tag in tags if "None" in run(capsys, "nodes", tag)[1]] == []


@pytest.mark.parametrize("form", ["xsd", "json"])
def test_schemas_contain_direction_of_ports(capsys, form):
    _, out, _ = run(capsys, "schema", "--format", form, "--nodes", "tests.nodes.port_leaves")
    assert "Output, takes a {key}. What was heard." in out
    assert "Input and output. Whatever it is." in out
    assert "Input. How loud." in out


def test_nodes_json_has_direction_of_ports(capsys):
    _, out, _ = run(capsys, "nodes", "Hear", "--nodes", "tests.nodes.port_leaves", "--format", "json")
    directions = {each["name"]: each["direction"] for each in json.loads(out)[0]["attributes"]}
    assert directions == {
        "name": None,
        "heard": "output",
        "anything": "inout",
        "volume": "input",
        **dict.fromkeys(["path", "wait", "policy", "log"]),
    }


def test_nodes_json_describes_attributes_completely(capsys):
    _, out, _ = run(capsys, "nodes", "Retry", "--format", "json")
    (retry,) = json.loads(out)
    assert retry["kind"] == "Decorator"
    assert retry["attributes"][1] == {
        "name": "num_failures",
        "role": "attribute",
        "direction": None,
        "type": "an integer",
        "refers_to": None,
        "required": True,
        "default": None,
        "doc": "Number of failures after which the node fails. With 1 or less, it fails after the first failure.",
    }


def test_nodes_of_unknown_tag_suggests_similar_tag(capsys):
    status, _, err = run(capsys, "nodes", "Retyr")
    assert (status, err) == (2, "sar-compile: there is no node 'Retyr'; did you mean 'Retry'?\n")


def test_custom_leaves_are_known_to_commands(capsys, tmp_path):
    path = tmp_path / "say.xml"
    path.write_text(document('<Say message="hi"/>'), encoding="utf-8")
    leaves = ["--nodes", "tests.nodes.leaves"]
    assert run(capsys, "validate", *leaves, str(path))[0] == 0
    assert run(capsys, "show", *leaves, str(path))[1] == "--> Say\n"
    assert "message: a string. required. What to say" in run(capsys, "nodes", *leaves, "Say")[1]
    assert '<xs:element name="Say"' in run(capsys, "schema", *leaves)[1]


@pytest.mark.parametrize("command", ["format", "diff", "explain", "completion"])
def test_command_that_needs_no_nodes_has_no_nodes_option(capsys, command):
    with pytest.raises(SystemExit) as ended:
        main([command, "--help"])
    assert ended.value.code == 0
    assert "--nodes" not in capsys.readouterr().out


def test_module_that_cannot_be_imported_has_status_2(capsys):
    status, _, err = run(capsys, "validate", "--nodes", "no.such.module", SHIPPED)
    assert status == 2
    assert err.startswith("sar-compile: the module of leaves 'no.such.module' (--nodes) cannot be imported")


@pytest.mark.parametrize(
    ("written", "words"),
    [
        ("tests/nodes/leaves.py", "is a file; write its import path: --nodes tests.nodes.leaves"),
        ("./tests/nodes/leaves.py", "write its import path: --nodes tests.nodes.leaves"),
        ("tests/nodes/leaves", "write its import path: --nodes tests.nodes.leaves"),
        ("leaves.py", "write its import path: --nodes leaves"),
        ("/elsewhere/leaves.py", "a module that is installed or in the current folder: --nodes PKG.MOD"),
        ("../leaves.py", "a module that is installed or in the current folder: --nodes PKG.MOD"),
    ],
)
def test_file_given_as_module_is_reported_with_import_path(capsys, written, words):
    status, _, err = run(capsys, "nodes", "--nodes", written)
    assert status == 2
    assert err.startswith(f"sar-compile: '{written}' (--nodes) is a file; ")
    assert err.endswith(f"{words}\n")


def test_module_without_nodes_is_rejected(capsys):
    status, _, err = run(capsys, "nodes", "--nodes", "json")
    assert (status, err) == (2, "sar-compile: the module 'json' (--nodes) registers no node\n")


def test_package_without_nodes_suggests_its_module_with_nodes(capsys):
    status, _, err = run(capsys, "nodes", "--nodes", "examples.decorators")
    assert status == 2
    assert err.endswith("registers no node; did you mean 'examples.decorators.leaves'?\n")


def test_drawing_shows_tag_of_leaf_or_decorator_with_different_name(capsys, tmp_path):
    path = tmp_path / "named.xml"
    path.write_text(
        '<root BTCPP_format="4" main_tree_to_execute="M"><BehaviorTree ID="M"><Sequence name="All">'
        '<RunOnce name="Once"><NavigateToBase name="Home" oneshot="ON_COMPLETION"/></RunOnce>'
        '<ZonesRemaining name="ZonesRemaining?"/><SubTree ID="Rest"/><SubTree ID="Rest" name="Again"/>'
        '</Sequence></BehaviorTree><BehaviorTree ID="Rest"><AlwaysSuccess/></BehaviorTree></root>'
    )
    assert run(capsys, "show", str(path))[1].splitlines() == [
        "{-} All",
        "    -^- Once  <RunOnce>",
        "        -^- HomeOneShot",
        "            --> Home  <NavigateToBase>",
        "    --> ZonesRemaining?",
        "    -^- Rest  <SubTree>",
        "        --> AlwaysSuccess",
        '    -^- Again  <SubTree ID="Rest">',
        "        --> AlwaysSuccess",
    ]


def test_tags_are_not_added_if_name_has_several_lines():
    tree = compile_for_test("search_and_rescue")
    tree.root.name = "two\nlines"
    assert add_tags(unicode_tree(tree.root), tree) == unicode_tree(tree.root)


@pytest.mark.parametrize(
    ("form", "begins"),
    [("svg", "<svg xmlns="), ("mermaid", "flowchart TD\n"), ("dot", 'digraph "SearchAndRescue" {')],
)
def test_picture_is_printed(capsys, form, begins):
    status, out, err = run(capsys, "show", "search_and_rescue", "--format", form)
    assert (status, err) == (0, "")
    assert out.startswith(begins)
    assert out.count("NavigateToBaseOneShot") >= 1


def test_flowchart_too_large_for_github_is_printed_with_note(capsys, tmp_path):
    path = tmp_path / "large.xml"
    path.write_text(document("<Sequence>" + "<AlwaysSuccess/>" * 500 + "</Sequence>"))
    status, out, err = run(capsys, "show", str(path), "--format", "mermaid")
    assert status == 0
    assert out.count(" --> ") == 500
    assert err == "sar-compile: this flowchart is too large for GitHub and GitLab. Use --format svg\n"


def test_schema_prints_committed_schema(capsys):
    assert run(capsys, "schema")[1] == Path("schemas/sar_tree.xsd").read_text(encoding="utf-8")


def test_installed_command_tolerates_closed_pipe():
    command = Path(sys.executable).with_name("sar-compile")
    pipe = f"{command} schema | head -1"
    done = subprocess.run(["/bin/sh", "-c", pipe], capture_output=True, text=True, check=False)
    assert (done.stdout, done.stderr) == ('<?xml version="1.0" encoding="UTF-8"?>\n', "")


@pytest.mark.parametrize("form", ["unicode", "json", "svg"])
def test_output_file_equals_standard_output(capsys, tmp_path, form):
    out = tmp_path / "out"
    assert run(capsys, "show", SHIPPED, "--format", form, "-o", out) == (0, "", "")
    assert run(capsys, "show", SHIPPED, "--format", form) == (0, out.read_text(encoding="utf-8"), "")


def test_plain_text_of_page_has_no_markdown_markup():
    page = '# `wrong-value`\n\n*error*\n\nAs [here](a.md#b) **it is**.\n\n```xml\n<A x="`"/>\n\n```\n'
    said = plain_text(page, lambda text, part: f"<{part} {text}>")
    assert said == '<place wrong-value>\n\nerror\n\nAs here it is.\n\n    <A x="`"/>\n\n'


def test_subtrees_are_folded_only_in_pictures(capsys):
    assert main(["show", "search_and_rescue_guarded", "--format", "dot", "--fold"]) == 0
    picture = capsys.readouterr().out
    assert "ResilientSearchAndRescue" in picture
    assert "NavigateToZone" not in picture
    assert main(["show", "search_and_rescue_guarded", "--fold"]) == 2
    assert "--fold applies to pictures: add --format svg, mermaid, dot" in capsys.readouterr().err
