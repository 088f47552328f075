"""A tree compiles to the same, whichever form it is written in."""

import json

import pytest

from sar_compiler.cli.compile import main

EXAMPLE = "examples/drive_to_goal/drive_to_goal.xml"


def shown(capsys, path, *nodes):
    assert main(["show", str(path), "--format", "json", *nodes]) == 0
    return json.loads(capsys.readouterr().out, object_hook=_without_place)


def _without_place(fields):
    return {name: value for name, value in fields.items() if name not in ("file", "line")}


@pytest.mark.parametrize(
    ("path", "nodes"),
    [
        ("trees/search_and_rescue.xml", ()),
        (EXAMPLE, ("--nodes", "examples.drive_to_goal.leaves")),
    ],
)
def test_a_tree_and_its_conversion_compile_to_equal_trees(capsys, tmp_path, path, nodes):
    converted = tmp_path / "tree.yaml"
    assert main(["convert", path, "--to", "yaml", "-o", str(converted)]) == 0
    assert shown(capsys, converted, *nodes) == shown(capsys, path, *nodes)


def test_both_forms_of_the_shipped_tree_compile_to_equal_trees(capsys):
    assert shown(capsys, "trees/search_and_rescue.yaml") == shown(capsys, "trees/search_and_rescue.xml")


def test_findings_stand_where_they_are_in_yaml(capsys, tmp_path):
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
