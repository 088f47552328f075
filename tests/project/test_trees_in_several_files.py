"""Tests of projects whose configuration names the files of subtrees."""

import json

import pytest

from sar_compiler import TreeError, UnreadableFileError, load
from sar_compiler.cli.compile import main
from sar_compiler.testing import compile_for_test, simulate
from tests.trees import document

MAIN = document('<Sequence><SubTree ID="Out"/><SubTree ID="Home"/></Sequence>')
TREES = '[project]\ntrees = ["trees/"]\n'


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    write(tmp_path, "main.xml", MAIN)
    write(
        tmp_path,
        "trees/out.xml",
        document('<Sequence><NavigateToZone/><SubTree ID="Home"/></Sequence>', "Out"),
    )
    write(
        tmp_path,
        "trees/home.yaml",
        "root:\n  children:\n    - BehaviorTree:\n        ID: Home\n        children: [NavigateToBase]\n",
    )
    write(tmp_path, "trees/map.yaml", "image: map.pgm\n")
    return tmp_path


def write(folder, name, text):
    path = folder / name
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text, encoding="utf-8")


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("sar.toml", TREES),
        ("sar.toml", '[project]\ntrees = ["trees/out.xml", "trees/h*.yaml"]\n'),
        ("pyproject.toml", '[tool.sar.project]\ntrees = ["trees/**/*"]\n'),
    ],
)
def test_tree_is_compiled_with_subtrees_of_other_files(folder, name, text):
    write(folder, name, text)
    names = [behaviour.name for behaviour in compile_for_test("main.xml").root.iterate()]
    assert names.count("NavigateToBase") == 2
    assert names.count("NavigateToZone") == 1


def test_isolated_file_is_loaded_without_other_files(folder):
    write(folder, "sar.toml", TREES)
    with pytest.raises(TreeError, match="there is no tree 'Out'"):
        load("main.xml", isolated=True).compile()


@pytest.mark.parametrize("command", ["validate", "show", "simulate", "verify"])
def test_every_command_uses_subtrees_of_other_files(folder, command):
    write(folder, "sar.toml", TREES)
    assert main([command, "main.xml"]) == 0


def test_program_can_simulate_and_verify_tree_with_subtrees_of_other_files(folder):
    write(folder, "sar.toml", TREES)
    run = simulate("main.xml", NavigateToZone="arrived").run_to_end()
    run.expect(root="SUCCESS")
    assert load("main.xml").verify().is_proved


def test_show_reports_file_and_line_of_node_in_other_file(folder, capsys):
    write(folder, "sar.toml", TREES)
    assert main(["show", "--format", "json", "main.xml"]) == 0
    out = json.loads(capsys.readouterr().out)["children"][0]
    assert (out["children"][0]["file"], out["children"][0]["line"]) == ("trees/out.xml", 3)


def test_path_outside_repository_is_rejected(folder):
    write(folder, "sar.toml", '[project]\ntrees = ["../elsewhere"]\n')
    with pytest.raises(TreeError, match=r"error\[setting-outside\]: trees: '\.\./elsewhere' is outside"):
        load("main.xml")


def test_link_out_of_repository_is_not_followed(folder, tmp_path_factory):
    elsewhere = tmp_path_factory.mktemp("elsewhere")
    (folder / "trees" / "out.xml").rename(elsewhere / "out.xml")
    (folder / "trees" / "out.xml").symlink_to(elsewhere / "out.xml")
    write(folder, "sar.toml", TREES)
    with pytest.raises(TreeError, match="there is no tree 'Out'"):
        compile_for_test("main.xml")


def test_missing_file_is_reported_only_if_tree_is_missing(folder):
    write(folder, "sar.toml", '[project]\ntrees = ["gone.xml"]\n')
    with pytest.raises(UnreadableFileError, match=r"cannot read gone\.xml"):
        load("main.xml")
    write(folder, "single.xml", document("<NavigateToBase/>"))
    assert load("single.xml").check() == []


def test_setting_of_wrong_shape_is_located(folder):
    write(folder, "sar.toml", '[project]\ntrees = "trees"\n')
    with pytest.raises(TreeError, match=r"sar\.toml:2:10: error\[wrong-shape\]"):
        load("main.xml")


PALETTE = (
    '<root><TreeNodesModel><SubTree ID="OpenGripper"><input_port name="force"/><output_port name="held" default=""/>'
    "</SubTree></TreeNodesModel></root>"
)


@pytest.fixture
def palette(folder):
    write(folder, "nodes.xml", PALETTE)
    write(folder, "sar.toml", 'models = ["nodes.xml"]\n')


def codes(tree):
    return [(finding.code, finding.suggestion) for finding in load(tree).check()]


def test_tree_described_by_palette_is_known(folder, palette):
    write(folder, "grip.xml", document('<SubTree ID="OpenGripper" force="3" _autoremap="true"/>'))
    assert codes("grip.xml") == []
    assert "OpenGripper" in [behaviour.name for behaviour in compile_for_test("grip.xml").root.iterate()]


def test_ports_of_described_tree_are_checked(folder, palette):
    write(folder, "grip.xml", document('<SubTree ID="OpenGripper" force="3" hold="{h}" _autoremap="true"/>'))
    assert codes("grip.xml") == [("unused-argument", "held")]
    write(folder, "grip.xml", document('<SubTree ID="OpenGripper"/>'))
    assert [code for code, _ in codes("grip.xml")] == ["missing-attribute", "missing-attribute"]


@pytest.mark.parametrize("command", ["simulate", "verify"])
def test_tree_that_is_only_described_is_not_executed(folder, palette, capsys, command):
    write(folder, "grip.xml", document('<SubTree ID="OpenGripper" force="3" _autoremap="true"/>'))
    assert main([command, "grip.xml"]) == 1
    assert (
        "error[not-installed]: the tree 'OpenGripper' is described by a model, but no file contains it"
        in (capsys.readouterr().err)
    )


def test_existing_tree_takes_precedence_over_its_description(folder, palette):
    write(folder, "grip.xml", document('<SubTree ID="OpenGripper" force="3" _autoremap="true"/>'))
    write(
        folder,
        "trees/gripper.xml",
        document("<Sequence><NavigateToBase/><AlwaysSuccess/></Sequence>", "OpenGripper"),
    )
    write(folder, "sar.toml", 'models = ["nodes.xml"]\n' + TREES)
    assert load("grip.xml").verify().is_proved


def test_error_about_missing_main_tree_lists_trees_and_remedy(folder, capsys):
    write(
        folder,
        "two.xml",
        document("<NavigateToBase/>", "A b")
        .replace("</root>", '<BehaviorTree ID="B"><Failure/></BehaviorTree></root>')
        .replace("A b", "A"),
    )
    assert main(["validate", "two.xml"]) == 0
    capsys.readouterr()
    for command in ("simulate", "verify"):
        assert main([command, "two.xml"]) != 0
        err = capsys.readouterr().err
        assert (
            "error[no-main-tree]: the file has 2 trees (A, B), but does not say which is the main tree" in err
        )
        assert 'select the main tree with --tree A, or write main_tree_to_execute="A"' in err
        assert main([command, "two.xml", "--tree", "A"]) == 0


PROJECT = (
    '<root BTCPP_format="4" project_name="Project">\n  {}\n  <TreeNodesModel>{}</TreeNodesModel>\n</root>\n'
)


def test_includes_of_groot2_project_are_checked(folder, capsys):
    write(folder, "a.xml", document("<OpenDoor/>", "A"))
    write(folder, "b.xml", document('<SubTree ID="A"/>', "B"))
    model = '<Action ID="OpenDoor"/>'
    write(folder, "Project.btproj", PROJECT.format('<include path="a.xml"/><include path="b.xml"/>', model))
    assert codes("Project.btproj") == []
    write(folder, "Project.btproj", PROJECT.format('<include path="a.xml"/><include path="c.xml"/>', model))
    assert codes("Project.btproj") == [("unreadable-include", None)]


def test_message_about_groot2_project_calls_it_project(folder, capsys):
    for name in ("a", "b"):
        write(folder, f"{name}.xml", document("<NavigateToBase/>", name))
    write(folder, "Project.btproj", PROJECT.format('<include path="a.xml"/><include path="b.xml"/>', ""))
    assert main(["simulate", "Project.btproj"]) == 1
    assert (
        "this Groot2 project has 2 trees (a, b), but does not say which is the main tree"
        in capsys.readouterr().err
    )
    assert main(["simulate", "--tree", "a", "Project.btproj"]) == 0


def test_project_attribute_of_tree_file_is_ignored(folder):
    write(folder, "a.xml", document("<NavigateToBase/>").replace("<root", '<root project="P"'))
    assert codes("a.xml") == [("ignored-attribute", None)]
