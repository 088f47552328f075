"""Tests of internal errors: a rule that fails on a tree is a finding, and other rules and files are still reported."""

import json

import pytest

from sar_compiler import checks
from sar_compiler.checks import check, fixing
from sar_compiler.cli.compile import main
from sar_compiler.nodes.registry import default_registry
from sar_compiler.tree.forest import load_forest
from sar_compiler.writing import WriteError
from tests.trees import document, forest

NEEDLESS = document("<Sequence><AlwaysSuccess/></Sequence>")
TWO_ERRORS = "<Sequence>\n<Sucess/>\n<Retry><AlwaysSuccess/></Retry>\n</Sequence>"


def check_badly(context):
    """Fail on the first node of each tree."""
    yield from ()
    for tree in context.trees:
        _fail_on(tree.nodes[0])


def _fail_on(bound):
    return bound.children[7]


def check_bound(context):
    """Fail with the same error as another rule."""
    return list(_fail_on(context.trees[0].nodes[0]))


@pytest.fixture
def failing_rule(monkeypatch):
    monkeypatch.setattr(checks, "RULES", (check_badly, *checks.RULES))


def findings_in(text):
    return [(each.code, each.span.line) for each in check(forest(text), default_registry())]


@pytest.mark.usefixtures("failing_rule")
def test_failing_rule_is_finding_at_its_node_and_other_rules_run():
    assert findings_in(TWO_ERRORS) == [("internal-error", 3), ("unknown-node", 4), ("missing-attribute", 5)]


@pytest.mark.usefixtures("failing_rule")
def test_finding_names_rule_error_and_location():
    finding, *_ = check(forest(TWO_ERRORS), default_registry())
    error = "the rule check_badly raised an error at this element: IndexError: list index out of range"
    assert finding.message == f"{error} (test_internal_errors.py, in _fail_on)"
    assert "report this error" in finding.advice


def test_same_error_in_several_rules_is_reported_once(monkeypatch):
    monkeypatch.setattr(checks, "RULES", (check_badly, check_bound, *checks.RULES))
    assert [code for code, _ in findings_in("<AlwaysSuccess/>")] == ["internal-error"]


@pytest.mark.usefixtures("failing_rule")
def test_validate_reports_other_findings_and_ends_with_status_3(tmp_path, capsys):
    for name in ("a.xml", "b.xml"):
        (tmp_path / name).write_text(NEEDLESS)
    assert main(["validate", str(tmp_path), "--format", "json"]) == 3
    codes = [(each["file"][-5:], each["code"]) for each in json.loads(capsys.readouterr().out)]
    each = ["internal-error", "needless-node"]
    assert codes == [(name, code) for name in ("a.xml", "b.xml") for code in each]


def test_internal_error_while_loading_file_does_not_hide_other_files(tmp_path, capsys, monkeypatch):
    def load_all_but_one(path, *others):
        if path.name == "a.xml":
            message = "a surprise"
            raise RuntimeError(message)
        return load_forest(path, *others)

    monkeypatch.setattr("sar_compiler.project.project_tree.load_forest", load_all_but_one)
    for name in ("a.xml", "b.xml"):
        (tmp_path / name).write_text(NEEDLESS)
    assert main(["validate", str(tmp_path)]) == 3
    output = capsys.readouterr().out
    assert (
        "a.xml:1:1: error[internal-error]: the check of this file failed: RuntimeError: a surprise" in output
    )
    assert "needless-node" in output


@pytest.mark.usefixtures("failing_rule")
def test_comment_cannot_suppress_internal_error(tmp_path):
    file = tmp_path / "a.xml"
    file.write_text(NEEDLESS.replace("<Sequence>", "<!-- sar: allow internal-error -->\n<Sequence>"))
    assert main(["validate", str(file)]) == 3


def test_unknown_children_do_not_break_rules_about_parent():
    assert findings_in("<TryCatch><AlwaysFailure/>\n<TestA/>\n<TestB/></TryCatch>") == [
        ("unknown-node", 4),
        ("unknown-node", 5),
    ]


def test_wrong_value_does_not_break_rules_about_keys():
    wrong = '<CheckBlackboardVariableValues checks="1" operator="and" namespace="{a}"/>'
    assert findings_in(f'<Sequence>\n<SubTree ID="B" a="x"/>\n{wrong}\n</Sequence>') == [
        ("unknown-tree", 4),
        ("wrong-value", 5),
    ]


OWN = "tests.analysis.verify.own_controls"


def test_failing_custom_function_is_finding_and_others_are_reported(tmp_path, capsys):
    (tmp_path / "a.xml").write_text(document("<Sequence>\n<OwnSlip><Success/></OwnSlip>\n</Sequence>"))
    (tmp_path / "b.xml").write_text(NEEDLESS)
    assert main(["validate", "--nodes", OWN, str(tmp_path), "--format", "json"]) == 1
    told = [(each["file"][-5:], each["line"], each["code"]) for each in json.loads(capsys.readouterr().out)]
    assert ("a.xml", 4, "faulty-class") in told
    assert ("b.xml", 3, "needless-node") in told


TYPO = document('<AlwaysSuccess naem="x"/>')
FIXED = document('<AlwaysSuccess name="x"/>')


def test_failing_fix_does_not_prevent_fixes_of_other_files(tmp_path, capsys, monkeypatch):
    def each_fix_but_one(source, *others):
        if source.path.endswith("a.xml"):
            message = "a surprise"
            raise RuntimeError(message)
        return each_fix(source, *others)

    each_fix = fixing.each_fix
    monkeypatch.setattr(fixing, "each_fix", each_fix_but_one)
    files = [tmp_path / name for name in ("a.xml", "b.xml")]
    for file in files:
        file.write_text(TYPO)
    assert main(["validate", "--fix", *map(str, files), "--format", "github"]) == 3
    assert [file.read_text() for file in files] == [TYPO, FIXED]
    output = capsys.readouterr().out
    assert "the fixing of this file failed: RuntimeError: a surprise" in output
    assert "unknown-attribute" in output


def test_unwritable_file_does_not_prevent_fixes_of_other_files(tmp_path, capsys, monkeypatch):
    def write_all_but_one(path, data):
        if path.name == "a.xml":
            message = f"cannot write {path}: it is in a museum"
            raise WriteError(message)
        path.write_bytes(data)

    monkeypatch.setattr("sar_compiler.writing.write_bytes", write_all_but_one)
    files = [tmp_path / name for name in ("a.xml", "b.xml")]
    for file in files:
        file.write_text(TYPO)
    assert main(["validate", "--fix", *map(str, files)]) == 2
    assert [file.read_text() for file in files] == [TYPO, FIXED]
    output = capsys.readouterr()
    assert "it is in a museum" in output.err
    assert "a.xml:3:16: error[unknown-attribute]" in output.out
