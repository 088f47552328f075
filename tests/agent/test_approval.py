"""What a person has approved is what was read then, and nothing else."""

import json
from pathlib import Path

import pytest

from sar_compiler.agent.approval import ApprovalError, approval_folder, require_approval
from sar_compiler.project import Additions, Workspace, load
from tests.cli.running import run
from tests.trees import write

PART = '<BehaviorTree ID="Part"><AlwaysSuccess/></BehaviorTree>'
WHOLE = '<BehaviorTree ID="Whole"><SubTree ID="Part"/></BehaviorTree>'
ELSEWHERE = '<BehaviorTree ID="Elsewhere"><AlwaysFailure/></BehaviorTree>'


@pytest.fixture(autouse=True)
def here(tmp_path, monkeypatch):
    """Work in an empty folder, as a user who has approved nothing."""
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    (tmp_path / "work").mkdir()
    monkeypatch.chdir(tmp_path / "work")


@pytest.fixture
def tree():
    """Write a tree with a file that it includes."""
    write("part.xml", PART)
    write("whole.xml", '<include path="part.xml"/>', WHOLE, main="Whole")
    return "whole.xml"


def approve(capsys, *arguments):
    return run(capsys, "approve", *arguments)


def refusal(name, **additions):
    """Return why a tree may not be started; None if it may."""
    try:
        require_approval(Workspace(Additions(**additions)).load(name))
    except ApprovalError as error:
        return str(error)
    return None


def test_a_tree_that_nobody_has_approved_is_refused_with_what_to_type(tree):
    said = refusal(tree)
    assert said is not None
    assert said.startswith("whole.xml is not approved")
    assert said.endswith("sar-compile approve whole.xml")


def test_what_was_approved_may_start_as_long_as_it_is_so(tree, capsys):
    status, said, _ = approve(capsys, tree, "--by", "Ada")
    assert status == 0
    assert "whole.xml: approved by Ada on 2" in said
    assert "+00:00, digest " in said
    assert refusal(tree) is None
    Path(tree).touch()
    assert refusal(tree) is None


@pytest.mark.parametrize("changed", ["whole.xml", "part.xml"])
def test_the_file_that_has_changed_is_named(tree, changed, capsys):
    approve(capsys, tree, "--by", "Ada")
    with Path(changed).open("a", encoding="utf-8") as file:
        file.write("\n")
    said = refusal(tree)
    assert said is not None
    assert said.startswith("whole.xml is not what Ada approved on 2")
    assert f": {changed} has changed; look at it, then: sar-compile approve whole.xml" in said


def test_a_file_that_is_included_now_and_one_that_is_not_any_more_are_named(tree, capsys):
    approve(capsys, tree)
    write("other.xml", PART)
    write("whole.xml", '<include path="other.xml"/>', WHOLE, main="Whole")
    said = refusal(tree)
    assert said is not None
    for each in ("whole.xml has changed", "other.xml is new", "part.xml is not part of it any more"):
        assert each in said


def test_the_files_of_a_set_that_trees_come_from_belong_to_it(capsys):
    write("part.xml", '<include path="deep.xml"/>', PART.replace("<AlwaysSuccess/>", '<SubTree ID="Deep"/>'))
    write("deep.xml", PART.replace("Part", "Deep"))
    write("unused.xml", ELSEWHERE)
    write("whole.xml", WHOLE)
    Path("sar.toml").write_text('[project]\ntrees = ["*.xml"]\n', encoding="utf-8")
    approve(capsys, "whole.xml")
    write("unused.xml", ELSEWHERE.replace("Failure", "Success"))
    assert refusal("whole.xml") is None
    write("deep.xml", ELSEWHERE.replace("Elsewhere", "Deep"))
    assert "deep.xml has changed" in str(refusal("whole.xml"))


def test_what_was_read_counts_and_not_what_stands_there_by_now(tree, capsys):
    approve(capsys, tree)
    read = load(tree)
    Path("part.xml").write_text("", encoding="utf-8")
    require_approval(read)


def test_a_tree_with_errors_is_shown_and_refused(capsys):
    write("wrong.xml", '<BehaviorTree ID="Main"><NoSuchNode/></BehaviorTree>')
    status, said, complaint = approve(capsys, "wrong.xml")
    assert status == 1
    assert "error[unknown-node]" in said
    assert "wrong.xml is not approved: it has errors" in complaint
    assert not approval_folder().exists()


def test_a_tick_that_raises_is_an_error_as_well(capsys):
    body = '<Sequence><Script code="a := \'x\'"/><ScriptCondition code="a * 2 == 6"/></Sequence>'
    write("raising.xml", f'<BehaviorTree ID="Main">{body}</BehaviorTree>')
    status, said, _ = approve(capsys, "raising.xml")
    assert (status, "error[failing-tick]" in said) == (1, True)


def test_warnings_are_shown_and_keep_nobody_from_approving(capsys):
    write("odd.xml", '<BehaviorTree ID="Main"><Inverter><Inverter><AlwaysSuccess/></Inverter></Inverter></BehaviorTree>',
          '<BehaviorTree ID="Unused"><AlwaysSuccess/></BehaviorTree>', main="Main")  # fmt: skip
    status, said, _ = approve(capsys, "odd.xml")
    assert (status, "warning[" in said) == (0, True)
    assert refusal("odd.xml") is None


def test_a_proposal_has_findings_proofs_and_the_digest_by_which_it_is_approved(tree, capsys):
    status, said, _ = approve(capsys, tree, "--propose")
    proposed = json.loads(said)
    assert (status, proposed["findings"], proposed["is_proved"]) == (0, [], True)
    assert sorted(proposed["files"]) == ["part.xml", "whole.xml"]
    assert {each["verdict"] for each in proposed["proofs"]["questions"]} == {"proved"}
    assert refusal(tree) is not None
    command = proposed["approve"].split()
    assert command[:2] == ["sar-compile", "approve"]
    assert approve(capsys, *command[2:])[0] == 0
    assert refusal(tree) is None


def test_what_is_not_as_it_was_proposed_is_not_approved(tree, capsys):
    proposed = json.loads(approve(capsys, tree, "--propose")[1])
    write("part.xml", PART.replace("Success", "Failure"))
    status, _, said = approve(capsys, tree, "--digest", proposed["digest"])
    assert (status, "it is not what was proposed" in said) == (2, True)
    assert refusal(tree) is not None


def test_the_digest_is_the_same_wherever_the_files_lie(tree, tmp_path, capsys):
    first = json.loads(approve(capsys, tree, "--propose")[1])
    Path.cwd().rename(tmp_path / "moved")
    second = json.loads(approve(capsys, tmp_path / "moved" / tree, "--propose")[1])
    assert first["digest"] == second["digest"]


def test_a_proposal_of_a_tree_with_errors_has_them_and_nothing_to_approve(capsys):
    write("wrong.xml", '<BehaviorTree ID="Main"><NoSuchNode/></BehaviorTree>')
    status, said, _ = approve(capsys, "wrong.xml", "--propose")
    proposed = json.loads(said)
    assert (status, proposed["is_proved"]) == (1, False)
    assert [each["code"] for each in proposed["findings"]] == ["unknown-node"]
    assert "approve" not in proposed


def test_a_proposal_of_what_is_no_xml_says_so(capsys):
    Path("half.xml").write_text("<root", encoding="utf-8")
    status, said, _ = approve(capsys, "half.xml", "--propose")
    assert status == 1
    assert [each["code"] for each in json.loads(said)["findings"]] == ["malformed-xml"]


def test_a_proposal_proves_the_properties_that_are_named(capsys):
    write("looking.xml", '<BehaviorTree ID="Main"><DetectSurvivor/></BehaviorTree>')
    Path("p.yaml").write_text(
        "properties: {nobody is there: {never: DetectSurvivor found}}\n", encoding="utf-8"
    )
    status, said, _ = approve(capsys, "looking.xml", "--propose", "--properties", "p.yaml")
    questions = json.loads(said)["proofs"]["questions"]
    answers = {each["question"]: each["verdict"] for each in questions}
    assert (status, answers["nobody is there"]) == (1, "does not hold")


def test_what_is_approved_is_listed_and_revoked(tree, capsys):
    approve(capsys, tree, "--by", "Ada")
    (told,) = approve(capsys, "--list")[1].splitlines()
    assert "whole.xml: approved by Ada on 2" in told
    Path(tree).unlink()
    assert approve(capsys, "--revoke", tree)[1] == f"no more: {told}\n"
    assert approve(capsys, "--list")[1] == ""
    status, _, said = approve(capsys, "--revoke", tree)
    assert (status, said) == (2, "sar-compile: whole.xml is not approved\n")


def test_a_later_approval_takes_the_place_of_an_earlier_one(tree, capsys):
    approve(capsys, tree, "--by", "Ada")
    approve(capsys, tree, "--by", "Grace")
    (told,) = approve(capsys, "--list")[1].splitlines()
    assert "approved by Grace" in told


@pytest.mark.parametrize("text", ["", "{}", "[]", '{"file": 1}', "null"])
def test_a_record_that_was_damaged_approves_nothing(tree, text, capsys):
    approve(capsys, tree)
    (record,) = approval_folder().iterdir()
    record.write_text(text, encoding="utf-8")
    assert "is no record of an approval: delete it" in str(refusal(tree))


def test_what_cannot_be_kept_is_not_approved(tree, capsys):
    approval_folder().parent.parent.mkdir(parents=True, exist_ok=True)
    approval_folder().parent.write_text("in the way", encoding="utf-8")
    status, _, said = approve(capsys, tree)
    assert (status, "cannot keep that" in said) == (2, True)


def test_who_names_no_file_is_told_what_to_name(capsys):
    status, _, said = approve(capsys)
    assert (status, said) == (2, "sar-compile: name the tree file to approve (or --list what is approved)\n")
