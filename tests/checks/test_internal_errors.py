"""A rule that fails on a tree is a finding about it; the other rules and the other files are told as ever."""

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
TWO_SLIPS = "<Sequence>\n<Sucess/>\n<Retry><AlwaysSuccess/></Retry>\n</Sequence>"


def check_badly(context):
    """Yield what is wrong with each tree, and fail on its first node."""
    yield from ()
    for tree in context.trees:
        _fail_on(tree.nodes[0])


def _fail_on(bound):
    return bound.children[7]


def check_bound(context):
    """Fail as every rule does that needs what fails."""
    return list(_fail_on(context.trees[0].nodes[0]))


@pytest.fixture
def failing(monkeypatch):
    monkeypatch.setattr(checks, "RULES", (check_badly, *checks.RULES))


def found(text):
    return [(each.code, each.span.line) for each in check(forest(text), default_registry())]


@pytest.mark.usefixtures("failing")
def test_a_rule_that_fails_is_a_finding_at_the_node_that_it_looked_at_and_the_others_go_on():
    assert found(TWO_SLIPS) == [("internal-error", 3), ("unknown-node", 4), ("missing-attribute", 5)]


@pytest.mark.usefixtures("failing")
def test_the_finding_names_the_rule_the_error_and_its_place():
    finding, *_ = check(forest(TWO_SLIPS), default_registry())
    error = "the rule check_badly raised an error at this element: IndexError: list index out of range"
    assert finding.message == f"{error} (test_internal_errors.py, in _fail_on)"
    assert "report this error" in finding.advice


def test_what_fails_for_several_rules_alike_is_told_once(monkeypatch):
    monkeypatch.setattr(checks, "RULES", (check_badly, check_bound, *checks.RULES))
    assert [code for code, _ in found("<AlwaysSuccess/>")] == ["internal-error"]


@pytest.mark.usefixtures("failing")
def test_validate_tells_all_else_and_ends_with_status_3(tmp_path, capsys):
    for name in ("a.xml", "b.xml"):
        (tmp_path / name).write_text(NEEDLESS)
    assert main(["validate", str(tmp_path), "--format", "json"]) == 3
    codes = [(each["file"][-5:], each["code"]) for each in json.loads(capsys.readouterr().out)]
    each = ["internal-error", "needless-node"]
    assert codes == [(name, code) for name in ("a.xml", "b.xml") for code in each]


def test_a_file_that_cannot_even_be_read_because_of_us_does_not_silence_the_others(
    tmp_path, capsys, monkeypatch
):
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


@pytest.mark.usefixtures("failing")
def test_no_comment_makes_a_failed_rule_unseen(tmp_path):
    file = tmp_path / "a.xml"
    file.write_text(NEEDLESS.replace("<Sequence>", "<!-- sar: allow internal-error -->\n<Sequence>"))
    assert main(["validate", str(file)]) == 3


def test_children_that_are_unknown_are_no_trouble_for_the_rules_about_their_parent():
    assert found("<TryCatch><AlwaysFailure/>\n<TestA/>\n<TestB/></TryCatch>") == [
        ("unknown-node", 4),
        ("unknown-node", 5),
    ]


def test_a_value_that_is_wrong_is_no_trouble_for_the_rules_about_keys():
    wrong = '<CheckBlackboardVariableValues checks="1" operator="and" namespace="{a}"/>'
    assert found(f'<Sequence>\n<SubTree ID="B" a="x"/>\n{wrong}\n</Sequence>') == [
        ("unknown-tree", 4),
        ("wrong-value", 5),
    ]


OWN = "tests.analysis.verify.own_controls"


def test_a_users_function_that_raises_is_a_finding_of_its_file_and_the_others_are_told(tmp_path, capsys):
    (tmp_path / "a.xml").write_text(document("<Sequence>\n<OwnSlip><Success/></OwnSlip>\n</Sequence>"))
    (tmp_path / "b.xml").write_text(NEEDLESS)
    assert main(["validate", "--nodes", OWN, str(tmp_path), "--format", "json"]) == 1
    told = [(each["file"][-5:], each["line"], each["code"]) for each in json.loads(capsys.readouterr().out)]
    assert ("a.xml", 4, "faulty-class") in told
    assert ("b.xml", 3, "needless-node") in told


SLIP = document('<AlwaysSuccess naem="x"/>')
MENDED = document('<AlwaysSuccess name="x"/>')


def test_a_fix_that_fails_does_not_keep_the_other_files_from_being_mended(tmp_path, capsys, monkeypatch):
    def each_fix_but_one(source, *others):
        if source.path.endswith("a.xml"):
            message = "a surprise"
            raise RuntimeError(message)
        return each_fix(source, *others)

    each_fix = fixing.each_fix
    monkeypatch.setattr(fixing, "each_fix", each_fix_but_one)
    files = [tmp_path / name for name in ("a.xml", "b.xml")]
    for file in files:
        file.write_text(SLIP)
    assert main(["validate", "--fix", *map(str, files), "--format", "github"]) == 3
    assert [file.read_text() for file in files] == [SLIP, MENDED]
    output = capsys.readouterr().out
    assert "the fixing of this file failed: RuntimeError: a surprise" in output
    assert "unknown-attribute" in output


def test_a_file_that_cannot_be_written_does_not_keep_the_others_from_being_mended(
    tmp_path, capsys, monkeypatch
):
    def write_all_but_one(path, data):
        if path.name == "a.xml":
            message = f"cannot write {path}: it is in a museum"
            raise WriteError(message)
        path.write_bytes(data)

    monkeypatch.setattr("sar_compiler.writing.write_bytes", write_all_but_one)
    files = [tmp_path / name for name in ("a.xml", "b.xml")]
    for file in files:
        file.write_text(SLIP)
    assert main(["validate", "--fix", *map(str, files)]) == 2
    assert [file.read_text() for file in files] == [SLIP, MENDED]
    output = capsys.readouterr()
    assert "it is in a museum" in output.err
    assert "a.xml:3:16: error[unknown-attribute]" in output.out
