"""Tests of approvals: only the approved files, parameters and properties may be used."""

import json
from pathlib import Path

import pytest

from sar_compiler.analysis.approval import ApprovalCheck, ApprovalError, approval_folder
from sar_compiler.analysis.verify.properties import read_property_file
from sar_compiler.loaded_tree import load
from sar_compiler.missions.mission_start import read_parameters
from tests.cli.command_runner import run
from tests.trees import write

PART = '<BehaviorTree ID="Part"><AlwaysSuccess/></BehaviorTree>'
WHOLE = '<BehaviorTree ID="Whole"><SubTree ID="Part"/></BehaviorTree>'
ELSEWHERE = '<BehaviorTree ID="Elsewhere"><AlwaysFailure/></BehaviorTree>'


@pytest.fixture(autouse=True)
def empty_folder(tmp_path, monkeypatch):
    """Work in an empty folder, as a user without approvals."""
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


def refusal(name, tree_id=None, params=None, properties=None, **changed):
    """Return why a tree may not start, with some parameters changed; None if it may."""
    tree = load(name)
    try:
        check = ApprovalCheck(tree, tree_id, params, properties)
        if properties is not None:
            check.require_properties(read_property_file(properties).document.source)
        reader = read_parameters(tree, params, tree_id)
        check.require_parameters({**reader.parameters, **changed}, reader.files)
    except ApprovalError as error:
        return str(error)
    return None


def test_unapproved_tree_is_refused_with_approve_command(tree):
    said = refusal(tree)
    assert said is not None
    assert said.startswith("whole.xml is not approved")
    assert said.endswith("sar-compile approve whole.xml")


def test_approved_tree_may_start_while_unchanged(tree, capsys):
    status, said, _ = approve(capsys, tree, "--by", "Ada")
    assert status == 0
    assert "whole.xml (Whole): approved by Ada on 2" in said
    assert "+00:00, digest " in said
    assert refusal(tree) is None
    Path(tree).touch()
    assert refusal(tree) is None


@pytest.mark.parametrize("changed", ["whole.xml", "part.xml"])
def test_changed_file_is_named(tree, changed, capsys):
    approve(capsys, tree, "--by", "Ada")
    with Path(changed).open("a", encoding="utf-8") as file:
        file.write("\n")
    said = refusal(tree)
    assert said is not None
    assert said.startswith("whole.xml differs from the version that Ada approved on 2")
    assert f": {changed} has changed. Review the tree, then run: sar-compile approve whole.xml" in said


def test_added_and_removed_included_files_are_named(tree, capsys):
    approve(capsys, tree)
    write("other.xml", PART)
    write("whole.xml", '<include path="other.xml"/>', WHOLE, main="Whole")
    said = refusal(tree)
    assert said is not None
    for each in ("whole.xml has changed", "other.xml is new", "part.xml was removed"):
        assert each in said


def test_used_files_of_project_set_belong_to_approval(capsys):
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


def test_approval_check_uses_the_content_that_was_read(tree, capsys):
    approve(capsys, tree)
    read = load(tree)
    Path("part.xml").write_text("", encoding="utf-8")
    ApprovalCheck(read, None)


def test_errors_of_tree_are_printed_and_prevent_approval(capsys):
    write("wrong.xml", '<BehaviorTree ID="Main"><NoSuchNode/></BehaviorTree>')
    status, said, complaint = approve(capsys, "wrong.xml")
    assert status == 1
    assert "error[unknown-node]" in said
    assert "wrong.xml is not approved: it has errors" in complaint
    assert not approval_folder().exists()


def test_raising_tick_prevents_approval(capsys):
    body = '<Sequence><Script code="a := \'x\'"/><ScriptCondition code="a * 2 == 6"/></Sequence>'
    write("raising.xml", f'<BehaviorTree ID="Main">{body}</BehaviorTree>')
    status, said, _ = approve(capsys, "raising.xml")
    assert (status, "error[failing-tick]" in said) == (1, True)


def test_warnings_are_printed_and_do_not_prevent_approval(capsys):
    write("odd.xml", '<BehaviorTree ID="Main"><Inverter><Inverter><AlwaysSuccess/></Inverter></Inverter></BehaviorTree>',
          '<BehaviorTree ID="Unused"><AlwaysSuccess/></BehaviorTree>', main="Main")  # fmt: skip
    status, said, _ = approve(capsys, "odd.xml")
    assert (status, "warning[" in said) == (0, True)
    assert refusal("odd.xml") is None


def test_proposal_has_findings_proofs_and_digest_for_approval(tree, capsys):
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


def test_tree_that_differs_from_proposal_is_not_approved(tree, capsys):
    proposed = json.loads(approve(capsys, tree, "--propose")[1])
    write("part.xml", PART.replace("Success", "Failure"))
    status, _, said = approve(capsys, tree, "--digest", proposed["digest"])
    assert (status, "it differs from the proposal" in said) == (2, True)
    assert refusal(tree) is not None


def test_digest_does_not_depend_on_folder(tree, tmp_path, capsys):
    first = json.loads(approve(capsys, tree, "--propose")[1])
    Path.cwd().rename(tmp_path / "moved")
    second = json.loads(approve(capsys, tmp_path / "moved" / tree, "--propose")[1])
    assert first["digest"] == second["digest"]


def test_proposal_of_tree_with_errors_has_findings_and_no_approve_command(capsys):
    write("wrong.xml", '<BehaviorTree ID="Main"><NoSuchNode/></BehaviorTree>')
    status, said, _ = approve(capsys, "wrong.xml", "--propose")
    proposed = json.loads(said)
    assert (status, proposed["is_proved"]) == (1, False)
    assert [each["code"] for each in proposed["findings"]] == ["unknown-node"]
    assert "approve" not in proposed


def test_proposal_of_malformed_xml_reports_it(capsys):
    Path("half.xml").write_text("<root", encoding="utf-8")
    status, said, _ = approve(capsys, "half.xml", "--propose")
    assert status == 1
    assert [each["code"] for each in json.loads(said)["findings"]] == ["malformed-xml"]


def test_proposal_checks_given_properties(capsys):
    write("looking.xml", '<BehaviorTree ID="Main"><DetectSurvivor/></BehaviorTree>')
    Path("p.yaml").write_text(
        "properties: {nobody is there: {never: DetectSurvivor found}}\n", encoding="utf-8"
    )
    status, said, _ = approve(capsys, "looking.xml", "--propose", "--properties", "p.yaml")
    questions = json.loads(said)["proofs"]["questions"]
    answers = {each["question"]: each["verdict"] for each in questions}
    assert (status, answers["nobody is there"]) == (1, "does not hold")


def test_approval_is_listed_and_revoked(tree, capsys):
    approve(capsys, tree, "--by", "Ada")
    (told,) = approve(capsys, "--list")[1].splitlines()
    assert "whole.xml (Whole): approved by Ada on 2" in told
    Path(tree).unlink()
    assert approve(capsys, "--revoke", tree)[1] == f"revoked: {told}\n"
    assert approve(capsys, "--list")[1] == ""
    status, _, said = approve(capsys, "--revoke", tree)
    assert (status, said) == (2, "sar-compile: whole.xml is not approved\n")


def test_later_approval_replaces_earlier_one(tree, capsys):
    approve(capsys, tree, "--by", "Ada")
    approve(capsys, tree, "--by", "Grace")
    (told,) = approve(capsys, "--list")[1].splitlines()
    assert "approved by Grace" in told


@pytest.mark.parametrize("text", ["", "{}", "[]", '{"file": 1}', "null"])
def test_damaged_approval_record_is_refused(tree, text, capsys):
    approve(capsys, tree)
    (record,) = approval_folder().iterdir()
    record.write_text(text, encoding="utf-8")
    assert "is not a valid approval. Delete it" in str(refusal(tree))


def test_approval_that_cannot_be_stored_fails(tree, capsys):
    approval_folder().parent.parent.mkdir(parents=True, exist_ok=True)
    approval_folder().parent.write_text("in the way", encoding="utf-8")
    status, _, said = approve(capsys, tree)
    assert (status, "cannot store the approval of" in said) == (2, True)


def test_approve_without_file_asks_for_one(capsys):
    status, _, said = approve(capsys)
    assert (status, said) == (
        2,
        "sar-compile: name the tree file to approve, or list the approved files with --list\n",
    )


TWO = (
    '<BehaviorTree ID="Right"><AlwaysSuccess/></BehaviorTree>',
    '<BehaviorTree ID="Wrong"><Sequence><DetectSurvivor/></Sequence></BehaviorTree>',
)
NEVER = "properties: {nobody is there: {never: DetectSurvivor found}}\n"


class TestApprovedTree:
    @pytest.fixture(autouse=True)
    def two_trees(self):
        write("two.xml", *TWO, main="Right")
        Path("p.yaml").write_text(NEVER, encoding="utf-8")

    def test_other_tree_of_approved_file_may_not_start(self, capsys):
        approve(capsys, "two.xml")
        assert (refusal("two.xml"), refusal("two.xml", "Right")) == (None, None)
        said = refusal("two.xml", "Wrong")
        assert said is not None
        assert said.startswith("the tree 'Wrong' of two.xml is not approved (approved: Right)")
        assert said.endswith("sar-compile approve two.xml --tree=Wrong")

    def test_both_trees_of_file_are_approved_separately_and_revoked_together(self, capsys):
        approve(capsys, "two.xml", "--by", "Ada")
        approve(capsys, "two.xml", "--tree", "Wrong", "--by", "Grace")
        assert (refusal("two.xml"), refusal("two.xml", "Wrong")) == (None, None)
        listed = approve(capsys, "--list")[1]
        assert "two.xml (Right): approved by Ada" in listed
        assert "two.xml (Wrong): approved by Grace" in listed
        assert len(approve(capsys, "--revoke", "two.xml")[1].splitlines()) == 2
        assert refusal("two.xml") is not None

    def test_missing_tree_is_not_approved(self, capsys):
        status, _, said = approve(capsys, "two.xml", "--tree", "Nowhere")
        assert (status, "Nowhere" in said) == (2, True)
        assert not approval_folder().exists()

    @pytest.mark.parametrize(("tree", "is_proved"), [("Right", True), ("Wrong", False)])
    def test_proof_is_about_the_proposed_tree(self, tree, is_proved, capsys):
        proposed = json.loads(
            approve(capsys, "two.xml", "--propose", "--tree", tree, "--properties", "p.yaml")[1]
        )
        assert (proposed["is_proved"], proposed["tree"]) == (is_proved, tree)
        assert f"--tree={tree}" in proposed["approve"]

    def test_two_trees_have_different_digests(self, capsys):
        digests = {
            json.loads(approve(capsys, "two.xml", "--propose", "--tree", each)[1])["digest"]
            for each in ("Right", "Wrong")
        }
        assert len(digests) == 2


PARAMETERS = """/**:
  ros__parameters:
    tick_rate_hz: 5.0
    zone_order: [a, b]
    zones:
      a: {x: 1.0, y: 2.0, yaw: 0.0}
      b: {x: 2, y: 3.0, yaw: 0.0}
"""


class TestApprovedParameters:
    @pytest.fixture(autouse=True)
    def mission(self):
        write("mission.xml", '<BehaviorTree ID="Main"><ZonesRemaining/></BehaviorTree>')
        Path("q.yaml").write_text(PARAMETERS, encoding="utf-8")

    def test_run_may_start_with_equal_parameters_from_any_source(self, capsys):
        assert approve(capsys, "mission.xml", "--params", "q.yaml")[0] == 0
        Path("other.yaml").write_text(f"# the same values\n{PARAMETERS}", encoding="utf-8")
        for params in ("q.yaml", "other.yaml"):
            assert refusal("mission.xml", params=Path(params)) is None
        # Every node has use_sim_time, and ROS returns arrays for lists.
        assert refusal("mission.xml", params=Path("q.yaml"), use_sim_time=True, zone_order=("a", "b")) is None

    def test_changed_parameter_is_named_with_both_values_and_approve_command(self, capsys):
        approve(capsys, "mission.xml", "--params", "q.yaml", "--by", "Ada")
        said = refusal("mission.xml", params=Path("q.yaml"), tick_rate_hz=50.0)
        assert said is not None
        assert ": tick_rate_hz is 50.0, but was 5.0. Review the tree" in said
        assert said.endswith("sar-compile approve mission.xml --params=q.yaml")

    @pytest.mark.parametrize(
        ("old", "new", "told"),
        [
            ("tick_rate_hz: 5.0", "tick_rate_hz: 5.1", "tick_rate_hz is 5.1, but was 5.0"),
            ("    tick_rate_hz: 5.0\n", "", "tick_rate_hz is not given, but was 5.0"),
            ("x: 2,", "x: 2.5,", "zones.b.x is 2.5, but was 2"),
            (
                "    zone_order",
                "    robot_radius_m: 0.3\n    zone_order",
                "robot_radius_m is 0.3, but was not given",
            ),
            ("[a, b]", "[b, a]", 'zone_order is ["b", "a"], but was ["a", "b"]'),
        ],
    )
    def test_each_kind_of_parameter_change_is_refused(self, old, new, told, capsys):
        approve(capsys, "mission.xml", "--params", "q.yaml")
        assert old in PARAMETERS
        Path("q.yaml").write_text(PARAMETERS.replace(old, new), encoding="utf-8")
        assert f": {told}. Review the tree" in str(refusal("mission.xml", params=Path("q.yaml")))

    def test_at_most_three_changes_are_named(self, capsys):
        approve(capsys, "mission.xml")
        said = str(refusal("mission.xml", params=Path("q.yaml")))
        assert said.count(", but was ") == 3
        assert " more parameters. Review the tree" in said

    def test_default_parameters_are_approved_without_file(self, capsys):
        approve(capsys, "mission.xml")
        assert refusal("mission.xml") is None
        assert "tick_rate_hz is 9.0" in str(refusal("mission.xml", tick_rate_hz=9.0))

    def test_parameters_are_part_of_proposal_and_digest(self, capsys):
        first = json.loads(approve(capsys, "mission.xml", "--propose", "--params", "q.yaml")[1])
        assert (first["is_proved"], first["parameters"]["tick_rate_hz"]) == (True, 5.0)
        second = json.loads(approve(capsys, "mission.xml", "--propose")[1])
        assert first["digest"] != second["digest"]
        command = first["approve"].split()
        assert approve(capsys, *command[2:])[0] == 0
        assert refusal("mission.xml", params=Path("q.yaml")) is None

    def test_invalid_parameters_are_not_approved(self, capsys):
        Path("q.yaml").write_text(PARAMETERS.replace("5.0", "-5.0"), encoding="utf-8")
        status, _, said = approve(capsys, "mission.xml", "--params", "q.yaml")
        assert (status, "tick_rate_hz" in said) == (2, True)
        assert not approval_folder().exists()

    def test_areas_file_of_parameter_belongs_to_approval(self, capsys):
        square = [[11.0, 48.0], [11.001, 48.0], [11.001, 48.001], [11.0, 48.001], [11.0, 48.0]]
        area = {
            "type": "Feature",
            "properties": {"name": "north", "detection_range": 3.0},
            "geometry": {"type": "Polygon", "coordinates": [square]},
        }
        areas = {"type": "FeatureCollection", "features": [area]}
        Path("areas.geojson").write_text(json.dumps(areas), encoding="utf-8")
        Path("q.yaml").write_text(
            "/**: {ros__parameters: {areas_file: areas.geojson, georeference: {lat: 48.0, lon: 11.0, heading: 0.0}}}\n",
            encoding="utf-8",
        )
        proposed = json.loads(approve(capsys, "mission.xml", "--propose", "--params", "q.yaml")[1])
        assert list(proposed["named"]) == ["areas_file"]
        approve(capsys, "mission.xml", "--params", "q.yaml")
        assert refusal("mission.xml", params=Path("q.yaml")) is None
        # Even a space counts: users approve the file, not the values read from it.
        Path("areas.geojson").write_text(f"{json.dumps(areas)} ", encoding="utf-8")
        assert "areas.geojson has changed" in str(refusal("mission.xml", params=Path("q.yaml")))


class TestApprovedProperties:
    @pytest.fixture(autouse=True)
    def tree_and_properties(self):
        write("looking.xml", '<BehaviorTree ID="Main"><DetectSurvivor/></BehaviorTree>')
        Path("p.yaml").write_text(
            "properties: {somebody is there: {never: DetectSurvivor nothing}}\n", encoding="utf-8"
        )

    def test_run_may_use_approved_properties_or_none(self, capsys):
        approve(capsys, "looking.xml", "--properties", "p.yaml")
        assert refusal("looking.xml", properties=Path("p.yaml")) is None
        assert refusal("looking.xml") is None
        Path("p.yaml").write_text(NEVER, encoding="utf-8")
        said = str(refusal("looking.xml", properties=Path("p.yaml")))
        assert "p.yaml is not the approved properties file" in said

    def test_unapproved_properties_are_refused(self, capsys):
        approve(capsys, "looking.xml")
        said = str(refusal("looking.xml", properties=Path("p.yaml")))
        assert said.endswith("sar-compile approve looking.xml --properties=p.yaml")

    def test_digest_of_proposal_includes_properties(self, capsys):
        proposed = json.loads(approve(capsys, "looking.xml", "--propose", "--properties", "p.yaml")[1])
        Path("p.yaml").write_text(NEVER, encoding="utf-8")
        status, _, said = approve(capsys, *proposed["approve"].split()[2:])
        assert (status, "it differs from the proposal" in said) == (2, True)


class TestFilesOfOtherUsers:
    @pytest.mark.parametrize("mode", [0o777, 0o775, 0o1777])
    def test_approval_folder_writable_by_others_is_ignored(self, tree, mode, capsys):
        approve(capsys, tree)
        approval_folder().chmod(mode)
        said = str(refusal(tree))
        assert said.startswith(f"approvals in {approval_folder()} are ignored: other users can write to it.")
        assert said.endswith(f"chmod go-w {approval_folder()}")
        for arguments in (["--list"], ["--revoke", tree], [tree]):
            status, _, complaint = approve(capsys, *arguments)
            assert (status, "other users can write to it" in complaint) == (2, True)
        approval_folder().chmod(0o700)
        assert refusal(tree) is None

    @pytest.mark.parametrize("mode", [0o666, 0o660, 0o602])
    def test_approval_record_writable_by_others_is_ignored(self, tree, mode, capsys):
        approve(capsys, tree)
        (record,) = approval_folder().iterdir()
        record.chmod(mode)
        assert f"approvals in {record} are ignored: other users can write to it." in str(refusal(tree))

    def test_world_writable_parent_folder_is_refused_unless_sticky(self, tree, capsys):
        approve(capsys, tree)
        above = approval_folder().parent.parent
        above.chmod(0o777)
        said = str(refusal(tree))
        assert said.startswith(f"approvals in {above} are ignored: all users can write to that folder.")
        assert said.endswith(f"chmod o-w {above}")
        above.chmod(0o1777)
        assert refusal(tree) is None

    def test_approval_record_of_other_user_is_ignored(self, tree, capsys, monkeypatch):
        approve(capsys, tree)
        monkeypatch.setattr("os.geteuid", lambda: 12345)
        for place in (approval_folder(), *approval_folder().iterdir()):
            if place.stat().st_uid == 0:  # tests that run as root: root's files are trusted
                monkeypatch.setattr("sar_compiler.analysis.approval._TRUSTED_OWNERS", ())
        assert "it belongs to another user" in str(refusal(tree))
