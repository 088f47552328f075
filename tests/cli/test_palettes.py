"""Tests of palettes on the command line, which describe nodes that are not installed."""

import json
import shutil
from pathlib import Path

import pytest
from lxml import etree

from tests.cli.command_runner import run
from tests.trees import document

RIGHT = '<root><TreeNodesModel><Action ID="Fly"/></TreeNodesModel></root>'
WRONG = '<root><TreeNodesModel><Action ID="Fly"/><Action ID="Sequence"/></TreeNodesModel></root>'


@pytest.fixture
def tree(tmp_path):
    path = tmp_path / "tree.xml"
    path.write_text(document("<Fly/>"), encoding="utf-8")
    return str(path)


@pytest.fixture
def palette(tmp_path):
    def write(text):
        path = tmp_path / "palette.xml"
        path.write_text(text, encoding="utf-8")
        return str(path)

    return write


def test_palette_is_valid_file(capsys, palette):
    path = palette(RIGHT)
    assert run(capsys, "validate", path) == (0, f"{path}: no findings\n", "")


@pytest.mark.parametrize("name", ["turtle_tree_nodes.xml", "robot.btproj"])
@pytest.mark.parametrize("body", ["<Fly/>", '<Action ID="Fly"/>'])
@pytest.mark.parametrize("command", ["validate", "simulate"])
def test_palette_in_folder_of_tree_describes_its_nodes_and_is_named(capsys, tree, name, body, command):
    palette = Path(tree).with_name(name)
    palette.write_text(RIGHT, encoding="utf-8")
    Path(tree).write_text(document(body), encoding="utf-8")
    status, _, err = run(capsys, command, tree)
    assert (status, err) == (0, f"note: nodes are described by {palette}\n")
    assert run(capsys, command, "--isolated", tree)[0] == 1


@pytest.mark.parametrize("text", ["<root>", document("<Fly/>"), RIGHT.replace("Fly", "Swim"), ""])
def test_file_that_does_not_describe_node_is_not_named(capsys, tree, text):
    Path(tree).with_name("other.xml").write_text(text, encoding="utf-8")
    status, _, err = run(capsys, "validate", tree)
    assert (status, "described by" in err) == (1, False)


def test_show_of_palette_reports_missing_tree(capsys, palette):
    status, out, err = run(capsys, "show", palette(RIGHT))
    assert (status, out) == (1, "")
    assert "no-tree" in err


def test_palette_finding_is_reported_once_for_several_files(capsys, palette, tree):
    path = palette(WRONG)
    other = Path(shutil.copy(tree, Path(tree).with_name("other.xml")))
    status, out, _ = run(capsys, "validate", "--model", path, tree, str(other))
    assert status == 0
    assert out.count("model-mismatch") == 1
    assert out.endswith(f"{tree}: no findings\n{other}: no findings\n")


def test_findings_of_palette_among_checked_files_are_reported_once(capsys, palette, tree):
    path = palette(WRONG)
    status, out, _ = run(capsys, "validate", "--strict", "--model", path, tree, path)
    assert status == 1
    assert out.startswith(f"{path}:1:")
    assert (out.count("model-mismatch"), out.count("no findings")) == (1, 1)


def test_json_contains_palette_findings(capsys, palette, tree):
    status, out, _ = run(capsys, "validate", "--format", "json", "--model", palette(WRONG), tree, tree)
    assert (status, [finding["code"] for finding in json.loads(out)]) == (0, ["model-mismatch"])


@pytest.mark.parametrize("command", ["validate", "show", "verify", "simulate"])
def test_palette_with_finding_is_usable(capsys, palette, tree, command):
    assert run(capsys, command, "--model", palette(WRONG), tree)[0] == 0


def test_malformed_palette_is_only_finding(capsys, palette, tree):
    status, out, _ = run(capsys, "validate", "--model", palette("<root>"), tree, tree)
    assert (status, out.count("malformed-xml"), out.count(tree)) == (1, 1, 0)


def test_missing_palette_is_reported_once(capsys, tree):
    status, out, err = run(capsys, "validate", "--model", "nowhere.xml", tree, tree)
    assert (status, out) == (2, "")
    assert err == "sar-compile: cannot read nowhere.xml: No such file or directory\n"


DESCRIBED = """\
<root><TreeNodesModel>
  <Action ID="FollowPath"><input_port name="path">The way to follow.</input_port></Action>
  <Decorator ID="RateController"><input_port name="hz" type="double"/></Decorator>
</TreeNodesModel></root>
"""


def test_xml_schema_contains_nodes_of_palette(capsys, palette):
    status, out, err = run(capsys, "schema", "--model", palette(DESCRIBED))
    assert (status, err) == (0, "")
    schema = etree.XMLSchema(etree.fromstring(out.encode()))
    right, wrong = (
        etree.fromstring(document(f'<RateController hz="{hz}"><FollowPath path="{{p}}"/></RateController>'))
        for hz in ("10", "often")
    )
    assert schema.validate(right)
    assert not schema.validate(wrong)
    assert "<xs:documentation>Input. The way to follow.</xs:documentation>" in out


def test_json_schema_contains_nodes_of_several_palettes(capsys, palette, tmp_path):
    other = tmp_path / "other.xml"
    other.write_text(RIGHT)
    status, out, _ = run(
        capsys, "schema", "--format", "json", "--model", palette(DESCRIBED), "--model", str(other)
    )
    schema = json.loads(out)
    assert status == 0
    assert {"Fly", "FollowPath", "RateController"} <= {*schema["$defs"]["node"]["else"]["properties"]}
    assert (
        schema["$defs"]["tag.FollowPath"]["properties"]["path"]["description"] == "Input. The way to follow."
    )


def test_nodes_command_describes_nodes_of_palette(capsys, palette):
    assert (
        "path: input; a value. optional. The way to follow."
        in (run(capsys, "nodes", "FollowPath", "--model", palette(DESCRIBED))[1])
    )


@pytest.mark.parametrize("command", ["schema", "nodes"])
def test_malformed_palette_prevents_schema_and_node_list(capsys, palette, command):
    status, out, err = run(capsys, command, "--model", palette("<root><"))
    assert (status, out) == (1, "")
    assert "error[malformed-xml]" in err


def test_unknown_node_suggests_installed_palettes_that_describe_it(capsys, tmp_path):
    path = tmp_path / "tree.xml"
    path.write_text(document('<FollowPath path="{path}"/>'), encoding="utf-8")
    _, out, _ = run(capsys, "validate", str(path))
    assert "add a palette that describes it: --model nav2:jazzy or nav2:kilted or nav2:main" in out
    status, _, err = run(capsys, "nodes", "FollowPath")
    assert status == 2
    assert "Add a palette that describes it: --model nav2:jazzy or nav2:kilted or nav2:main" in err
