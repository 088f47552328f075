"""Tests of the formats of `validate` for tools, and of the effect of a project's configuration."""

import json
from pathlib import Path

import jsonschema
import pytest
import yaml

from sar_compiler.cli.compile import main
from tests.cli import command_runner
from tests.trees import document

NEEDLESS = document("<Sequence><ZonesRemaining/></Sequence>")
# The standard's requirements for the properties in use (SARIF 2.1.0, section 3); columns and lines start at 1.
_REGION = {
    "type": "object",
    "properties": {
        name: {"type": "integer", "minimum": 1}
        for name in ("startLine", "startColumn", "endLine", "endColumn")
    },
    "additionalProperties": False,
}
_MESSAGE = {
    "type": "object",
    "required": ["text"],
    "properties": {"text": {"type": "string", "minLength": 1}},
}
_LEVEL = {"enum": ["none", "note", "warning", "error"]}
_ARTIFACT = {
    "type": "object",
    "required": ["uri"],
    "properties": {"uri": {"type": "string", "pattern": r"^[\w.%/:~-]+$"}, "uriBaseId": {"type": "string"}},
    "additionalProperties": False,
}
_PHYSICAL = {"type": "object", "properties": {"artifactLocation": _ARTIFACT, "region": _REGION}}
_REPLACEMENT = {
    "type": "object",
    "required": ["deletedRegion"],
    "properties": {
        "deletedRegion": _REGION,
        "insertedContent": {
            "type": "object",
            "properties": {"text": {"type": "string"}},
            "additionalProperties": False,
        },
    },
    "additionalProperties": False,
}
_CHANGE = {
    "type": "object",
    "required": ["artifactLocation", "replacements"],
    "properties": {
        "artifactLocation": _ARTIFACT,
        "replacements": {"type": "array", "minItems": 1, "items": _REPLACEMENT},
    },
    "additionalProperties": False,
}
_FIX = {
    "type": "object",
    "required": ["artifactChanges"],
    "properties": {
        "description": _MESSAGE,
        "artifactChanges": {"type": "array", "minItems": 1, "uniqueItems": True, "items": _CHANGE},
    },
    "additionalProperties": False,
}
_RESULT = {
    "type": "object",
    "required": ["message", "ruleId"],
    "properties": {
        "level": _LEVEL,
        "message": _MESSAGE,
        "ruleIndex": {"type": "integer", "minimum": 0},
        "locations": {
            "type": "array",
            "items": {"type": "object", "properties": {"physicalLocation": _PHYSICAL}},
        },
        "fixes": {"type": "array", "items": _FIX, "uniqueItems": True},
    },
}
_RULE = {
    "type": "object",
    "required": ["id"],
    "properties": {
        "shortDescription": _MESSAGE,
        "help": _MESSAGE,
        "defaultConfiguration": {"type": "object", "properties": {"level": _LEVEL}},
    },
}
_DRIVER = {
    "type": "object",
    "required": ["name"],
    "properties": {"rules": {"type": "array", "items": _RULE, "uniqueItems": True}},
}
_RUN = {
    "type": "object",
    "required": ["tool", "results"],
    "properties": {
        "tool": {"type": "object", "required": ["driver"], "properties": {"driver": _DRIVER}},
        "columnKind": {"enum": ["utf16CodeUnits", "unicodeCodePoints"]},
        "newlineSequences": {"type": "array", "minItems": 1, "uniqueItems": True},
        "results": {"type": "array", "items": _RESULT},
    },
}
SARIF = {
    "type": "object",
    "required": ["version", "runs"],
    "properties": {"version": {"const": "2.1.0"}, "runs": {"type": "array", "items": _RUN}},
}


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


def run(capsys, *arguments):
    return command_runner.run(capsys, "validate", *arguments)


def test_sarif_conforms_to_standard(folder, capsys):
    (folder / "a tree.xml").write_text(document('<!-- 😀 --><Sequnce a="😀"/>'), encoding="utf-8")
    status, out, _ = run(capsys, "--format", "sarif", "a tree.xml")
    log = json.loads(out)
    jsonschema.validate(log, SARIF)
    assert status == 1
    (result,) = log["runs"][0]["results"]
    rule = log["runs"][0]["tool"]["driver"]["rules"][result["ruleIndex"]]
    assert (result["ruleId"], rule["id"], result["level"]) == ("unknown-node", "unknown-node", "error")
    assert rule["help"]["markdown"].startswith("# `unknown-node`")
    assert "did you mean 'Sequence'?" in result["message"]["text"]


def test_sarif_counts_columns_in_utf_16_units(folder, capsys):
    (folder / "a tree.xml").write_text(document("<!-- 😀 --><Sequnce/>"), encoding="utf-8")
    _, out, _ = run(capsys, "--format", "sarif", "a tree.xml")
    location = json.loads(out)["runs"][0]["results"][0]["locations"][0]["physicalLocation"]
    assert location["artifactLocation"] == {"uri": "a%20tree.xml", "uriBaseId": "%SRCROOT%"}
    assert location["region"] == {"startLine": 3, "startColumn": 12, "endLine": 3, "endColumn": 20}


def test_sarif_of_correct_tree_has_no_results(folder, capsys):
    (folder / "tree.xml").write_text(document("<NavigateToBase/>"), encoding="utf-8")
    status, out, _ = run(capsys, "--format", "sarif", str(folder / "tree.xml"))
    assert (status, json.loads(out)["runs"][0]["results"]) == (0, [])


def test_github_format_has_annotation_for_each_finding(folder, capsys):
    (folder / "a,b.xml").write_text(
        document('<Sequence memory="50%&#10;"><Sequnce/></Sequence>'), encoding="utf-8"
    )
    status, out, _ = run(capsys, "--format", "github", "a,b.xml")
    assert status == 1
    first, second = out.splitlines()
    assert first.startswith(
        "::error file=a%2Cb.xml,line=3,col=19,endLine=3,endColumn=26,title=wrong-value::memory: '50%25%0A'"
    )
    assert second == (
        "::error file=a%2Cb.xml,line=3,col=29,endLine=3,endColumn=36,title=unknown-node::"
        "there is no node 'Sequnce'%0Adid you mean 'Sequence'?"
    )


def test_github_format_prints_infos_as_notices(folder, capsys):
    (folder / "tree.xml").write_text(NEEDLESS, encoding="utf-8")
    status, out, _ = run(capsys, "--format", "github", "tree.xml")
    assert (status, out.split()[0]) == (0, "::notice")


def test_finding_turned_off_by_project_is_not_reported(folder, capsys):
    (folder / "tree.xml").write_text(NEEDLESS, encoding="utf-8")
    (folder / "sar.toml").write_text('[findings]\nneedless-node = "off"\n', encoding="utf-8")
    assert run(capsys, "tree.xml") == (0, "tree.xml: no findings\n", "")


def test_finding_raised_to_error_by_project_has_status_1(folder, capsys):
    (folder / "tree.xml").write_text(NEEDLESS, encoding="utf-8")
    (folder / "sar.toml").write_text('[findings]\nneedless-node = "error"\n', encoding="utf-8")
    status, out, _ = run(capsys, "tree.xml")
    assert status == 1
    assert "error[needless-node]" in out


def test_configuration_error_is_reported_once_and_no_tree_is_checked(folder, capsys):
    (folder / "tree.xml").write_text("<root", encoding="utf-8")
    (folder / "sar.toml").write_text("[finding]\n", encoding="utf-8")
    status, out, _ = run(capsys, "tree.xml", "tree.xml")
    assert status == 1
    assert out.startswith("sar.toml:1:2: error[unknown-key]: the configuration has no key 'finding'")
    assert out.count("error[") == 1


PALETTE = '<root><TreeNodesModel><Action ID="OpenDoor"/></TreeNodesModel></root>'


@pytest.mark.parametrize("command", ["validate", "show", "simulate"])
def test_palettes_of_project_apply_to_every_command(folder, capsys, command):
    (folder / "tree.xml").write_text(document("<OpenDoor/>"), encoding="utf-8")
    (folder / "nodes.xml").write_text(PALETTE, encoding="utf-8")
    (folder / "sar.toml").write_text('models = ["nodes.xml"]\n', encoding="utf-8")
    assert main([command, "tree.xml"]) == 0


def test_each_file_is_checked_with_palettes_of_its_project(folder, capsys):
    (folder / ".git").mkdir()
    for name in ("one", "two"):
        (folder / name).mkdir()
        (folder / name / "tree.xml").write_text(document("<OpenDoor/>"), encoding="utf-8")
    (folder / ".nodes.xml").write_text(PALETTE, encoding="utf-8")
    (folder / "one" / "sar.toml").write_text('models = ["../.nodes.xml"]\n', encoding="utf-8")
    status, out, _ = run(capsys, "one/tree.xml", "two/tree.xml")
    assert status == 1
    assert out.splitlines()[0].startswith("two/tree.xml:3:1: error[unknown-node]")
    assert out.splitlines()[-1] == "one/tree.xml: no findings"


def test_include_path_of_project_is_allowed(folder, capsys):
    for name in (".git", "shared", "trees"):
        (folder / name).mkdir()
    (folder / "shared" / "b.xml").write_text(document("<NavigateToBase/>", main="B"), encoding="utf-8")
    text = document('<SubTree ID="B"/>').replace("<Beh", '<include path="../shared/b.xml"/><Beh')
    (folder / "trees" / "a.xml").write_text(
        text.replace("<root", '<root main_tree_to_execute="Main"'), encoding="utf-8"
    )
    (folder / "trees" / "sar.toml").write_text('include-path = ["../shared"]\n', encoding="utf-8")
    assert run(capsys, "trees/a.xml") == (0, "trees/a.xml: no findings\n", "")


def test_fixes_are_reported_on_standard_error_with_json_format(folder, capsys):
    (folder / "tree.xml").write_text(document('<NavigateToZone oneshott="ON_COMPLETION"/>'), encoding="utf-8")
    status, out, error = run(capsys, "--fix", "--format", "json", "tree.xml")
    assert (status, json.loads(out)) == (0, [])
    assert error == "tree.xml:3:17: fixed[unknown-attribute]: oneshott -> oneshot\n"


def test_pre_commit_hooks_call_validate_and_format():
    hooks = {hook["id"]: hook for hook in yaml.safe_load(Path(".pre-commit-hooks.yaml").read_text("utf-8"))}
    assert {name: hook["entry"] for name, hook in hooks.items()} == {
        "sar-validate": "sar-compile validate",
        "sar-format": "sar-compile format",
    }
    assert {hook["language"] for hook in hooks.values()} == {"python"}
