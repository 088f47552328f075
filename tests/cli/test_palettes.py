"""Palettes on the command line: files that describe nodes which are not installed."""

import json
import shutil
from pathlib import Path

import pytest
from lxml import etree

from tests.cli.running import run
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


def test_a_palette_is_a_correct_file(capsys, palette):
    path = palette(RIGHT)
    assert run(capsys, "validate", path) == (0, f"{path}: no findings\n", "")


@pytest.mark.parametrize("name", ["turtle_tree_nodes.xml", "robot.btproj"])
@pytest.mark.parametrize("body", ["<Fly/>", '<Action ID="Fly"/>'])
@pytest.mark.parametrize("command", ["validate", "simulate"])
def test_a_palette_beside_a_file_describes_its_nodes_and_is_named(capsys, tree, name, body, command):
    palette = Path(tree).with_name(name)
    palette.write_text(RIGHT, encoding="utf-8")
    Path(tree).write_text(document(body), encoding="utf-8")
    status, _, err = run(capsys, command, tree)
    assert (status, err) == (0, f"note: nodes are described by {palette}\n")
    assert run(capsys, command, "--isolated", tree)[0] == 1


@pytest.mark.parametrize("text", ["<root>", document("<Fly/>"), RIGHT.replace("Fly", "Swim"), ""])
def test_what_does_not_describe_a_node_is_not_named_for_it(capsys, tree, text):
    Path(tree).with_name("other.xml").write_text(text, encoding="utf-8")
    status, _, err = run(capsys, "validate", tree)
    assert (status, "described by" in err) == (1, False)


def test_a_palette_has_no_tree_to_show(capsys, palette):
    status, out, err = run(capsys, "show", palette(RIGHT))
    assert (status, out) == (1, "")
    assert "no-tree" in err


def test_what_is_wrong_with_a_palette_is_said_once_however_many_files_are_checked(capsys, palette, tree):
    path = palette(WRONG)
    other = Path(shutil.copy(tree, Path(tree).with_name("other.xml")))
    status, out, _ = run(capsys, "validate", "--model", path, tree, str(other))
    assert status == 0
    assert out.count("model-mismatch") == 1
    assert out.endswith(f"{tree}: no findings\n{other}: no findings\n")


def test_a_palette_that_is_among_the_files_is_spoken_of_there_alone(capsys, palette, tree):
    path = palette(WRONG)
    status, out, _ = run(capsys, "validate", "--strict", "--model", path, tree, path)
    assert status == 1
    assert out.startswith(f"{path}:1:")
    assert (out.count("model-mismatch"), out.count("no findings")) == (1, 1)


def test_a_palette_that_is_wrong_is_data_too(capsys, palette, tree):
    status, out, _ = run(capsys, "validate", "--format", "json", "--model", palette(WRONG), tree, tree)
    assert (status, [finding["code"] for finding in json.loads(out)]) == (0, ["model-mismatch"])


@pytest.mark.parametrize("command", ["validate", "show", "verify", "simulate"])
def test_a_slip_in_a_palette_keeps_nobody_from_using_it(capsys, palette, tree, command):
    assert run(capsys, command, "--model", palette(WRONG), tree)[0] == 0


def test_a_palette_that_is_malformed_is_the_only_finding(capsys, palette, tree):
    status, out, _ = run(capsys, "validate", "--model", palette("<root>"), tree, tree)
    assert (status, out.count("malformed-xml"), out.count(tree)) == (1, 1, 0)


def test_a_palette_that_is_not_there_is_said_once(capsys, tree):
    status, out, err = run(capsys, "validate", "--model", "nowhere.xml", tree, tree)
    assert (status, out) == (2, "")
    assert err == "sar-compile: cannot read nowhere.xml: No such file or directory\n"


DESCRIBED = """\
<root><TreeNodesModel>
  <Action ID="FollowPath"><input_port name="path">The way to follow.</input_port></Action>
  <Decorator ID="RateController"><input_port name="hz" type="double"/></Decorator>
</TreeNodesModel></root>
"""


def test_an_editor_completes_by_the_xml_schema_what_a_palette_describes(capsys, palette):
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


def test_an_editor_completes_by_the_json_schema_what_several_palettes_describe(capsys, palette, tmp_path):
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


def test_what_a_palette_describes_is_among_what_can_be_written(capsys, palette):
    assert (
        "path: input; a value. optional. The way to follow."
        in (run(capsys, "nodes", "FollowPath", "--model", palette(DESCRIBED))[1])
    )


@pytest.mark.parametrize("command", ["schema", "nodes"])
def test_a_palette_that_cannot_be_read_gives_no_list(capsys, palette, command):
    status, out, err = run(capsys, command, "--model", palette("<root><"))
    assert (status, out) == (1, "")
    assert "error[malformed-xml]" in err


def test_a_node_that_an_installed_palette_knows_is_said_to_be_there(capsys, tmp_path):
    path = tmp_path / "tree.xml"
    path.write_text(document('<FollowPath path="{path}"/>'), encoding="utf-8")
    _, out, _ = run(capsys, "validate", str(path))
    assert "add a palette that describes it: --model nav2:jazzy or nav2:kilted or nav2:main" in out
    status, _, err = run(capsys, "nodes", "FollowPath")
    assert status == 2
    assert "Add a palette that describes it: --model nav2:jazzy or nav2:kilted or nav2:main" in err
