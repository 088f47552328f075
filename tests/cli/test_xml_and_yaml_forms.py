"""Tests that the XML form and the YAML form of a tree compile to equal trees."""

import json

import pytest

from sar_compiler.cli.compile import main

EXAMPLE = "examples/drive_to_goal/drive_to_goal.xml"


def compiled_json(capsys, path, *nodes):
    assert main(["show", str(path), "--format", "json", *nodes]) == 0
    return json.loads(capsys.readouterr().out, object_hook=_without_location)


def _without_location(fields):
    return {name: value for name, value in fields.items() if name not in ("file", "line")}


@pytest.mark.parametrize(
    ("path", "nodes"),
    [
        ("trees/search_and_rescue.xml", ()),
        (EXAMPLE, ("--nodes", "examples.drive_to_goal.leaves")),
    ],
)
def test_converted_tree_compiles_to_equal_tree(capsys, tmp_path, path, nodes):
    converted = tmp_path / "tree.yaml"
    assert main(["convert", path, "--to", "yaml", "-o", str(converted)]) == 0
    assert compiled_json(capsys, converted, *nodes) == compiled_json(capsys, path, *nodes)


def test_xml_and_yaml_of_shipped_tree_compile_to_equal_trees(capsys):
    assert compiled_json(capsys, "trees/search_and_rescue.yaml") == compiled_json(
        capsys, "trees/search_and_rescue.xml"
    )


def test_findings_have_locations_in_yaml_file(capsys, tmp_path):
    path = tmp_path / "tree.yaml"
    path.write_text(
        "root:\n  children:\n    - BehaviorTree:\n        ID: Main\n        children:\n"
        "          - Selector:\n              memory: no\n              children: [Success, Sucess]\n",
        encoding="utf-8",
    )
    assert main(["validate", str(path)]) == 1
    out = capsys.readouterr().out
    assert f"{path}:7:23: error[wrong-value]: memory: 'no' is neither true nor false" in out
    assert f"{path}:8:35: error[unknown-node]: there is no node 'Sucess'" in out
