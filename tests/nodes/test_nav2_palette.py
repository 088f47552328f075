"""Tests of the palettes of Nav2, by distribution."""

import re

import pytest
from py_trees.common import Status

from sar_compiler import TreeError, load
from sar_compiler.checks import check
from sar_compiler.leaves import Kind, register
from sar_compiler.nodes.nav2 import facts
from sar_compiler.nodes.palettes import PaletteError, is_palette_name, load_palettes
from sar_compiler.nodes.registry import load_registry
from sar_compiler.runtime.skipping import SkippableLeaf
from sar_compiler.tree.diagnostic import Severity
from tests.trees import document, errors, forest

DISTRIBUTIONS = ("jazzy", "kilted", "main")
REGISTRIES = {version: load_registry(palettes=[f"nav2:{version}"]) for version in DISTRIBUTIONS}


def tags_of(version):
    return {spec.tag for spec in load_palettes([f"nav2:{version}"])}


def error_messages(body, version="jazzy"):
    return [finding.message for finding in errors(forest(body), REGISTRIES[version])]


class TestDistributions:
    def test_each_distribution_has_its_registered_nodes(self):
        jazzy, kilted, main = map(tags_of, DISTRIBUTIONS)
        assert [len(tags) for tags in (jazzy, kilted, main)] == [65, 70, 81]
        assert "IsPathValid" in jazzy & kilted - main
        assert "ValidatePath" in main - kilted
        assert "NonblockingSequence" in main - kilted
        assert "IsStopped" in kilted - jazzy - main

    @pytest.mark.parametrize(
        "node", ["<RecoveryNode>{0}{0}</RecoveryNode>", "<RateController>{0}</RateController>"]
    )
    def test_parent_of_skippable_children_can_be_skipped(self, node):
        inside = node.format("<AlwaysSuccess _skipIf='@paused'/>")
        [finding] = errors(forest(f"<FailureIsRunning>{inside}</FailureIsRunning>"), REGISTRIES["jazzy"])
        assert finding.code == "skip-misread"

    def test_port_is_known_only_in_distributions_that_have_it(self):
        body = '<RoundRobin wrap_around="true"><IsStuck/></RoundRobin>'
        assert error_messages(body, "main") == []
        assert error_messages(body) == ["<RoundRobin> has no attribute 'wrap_around' (known: name, oneshot)"]
        body = '<Wait error_code_id="{e}"/>'
        assert len(error_messages(body)) == 1
        assert error_messages(body, "kilted") == error_messages(body, "main") == []

    def test_default_is_converted_to_value(self):
        parameters = REGISTRIES["main"]["TruncatePathLocal"].parameters
        assert parameters["max_robot_pose_search_dist"].default == float("inf")
        assert parameters["distance_forward"].default == 8.0

    def test_described_ports_are_exactly_those_of_nodes(self):
        lines = [
            line
            for part in ("nodes", "likes")
            for each in facts()[part].values()
            for line in each.get("ports", ())
        ]
        ports = {re.sub(r" (=|\[).*", "", line).split()[-1] for line in lines}
        assert ports == set(facts()["ports"])

    @pytest.mark.parametrize("version", DISTRIBUTIONS)
    def test_every_node_and_port_has_a_description(self, version):
        for spec in load_palettes([f"nav2:{version}"]):
            assert spec.doc.endswith((".", "?")), spec.tag
            undescribed = [p.name for p in spec.attributes if not p.doc and p.name != "name"]
            assert not undescribed, spec.tag

    def test_no_leaf_can_be_skipped_and_no_condition_can_be_running(self):
        leaves = [spec for spec in load_palettes(["nav2:jazzy"]) if spec.kind.is_leaf]
        assert not [spec.tag for spec in leaves if "SKIPPED" in spec.statuses]
        assert not [s.tag for s in leaves if s.kind is Kind.CONDITION and "RUNNING" in s.statuses]

    def test_usual_outcome_is_first(self):
        assert REGISTRIES["jazzy"]["GoalUpdated"].outcomes[0].status == "FAILURE"
        assert REGISTRIES["jazzy"]["IsPathValid"].outcomes[0].status == "SUCCESS"


class TestNumbers:
    @pytest.mark.parametrize(
        ("body", "suggestion", "hint"),
        [
            ('<Spin spin_dist="90deg"/>', "1.5708", "write only the number, in radians"),
            ('<Spin spin_dist="-90°"/>', "-1.5708", "write only the number, in radians"),
            ('<Wait wait_duration="500ms"/>', "0.5", "write only the number, in seconds"),
            ('<Wait wait_duration="2 V"/>', None, "write only the number, in seconds"),
            ('<Wait wait_duration="1,500ms"/>', None, "the comma is ambiguous: write 1.5, or 0.0015"),
            ('<BackUp backup_speed="0,1"/>', "0.1", "write only the number, in metres per second"),
            ('<Wait server_timeout="5s"/>', "5000", "write an integer in milliseconds, without a unit"),
            ('<Wait server_timeout="0.5ms"/>', None, "write an integer in milliseconds, without a unit"),
        ],
    )
    def test_number_with_unit_is_reported_with_converted_number_or_hint(self, body, suggestion, hint):
        [finding] = errors(forest(body), REGISTRIES["jazzy"])
        assert (finding.suggestion, finding.hint) == (suggestion, hint)

    @pytest.mark.parametrize(
        ("node", "name", "numbers", "bounds"),
        [
            ("RateController", "hz", ("0", "-2", "-inf", "nan"), "more than 0"),
            ("RecoveryNode", "number_of_retries", ("-1",), "0 or more"),
            ("RemoveInCollisionGoals", "cost_threshold", ("-1", "256"), "from 0 to 255"),
        ],
    )
    def test_implausible_number_is_warning(self, node, name, numbers, bounds):
        children = "<IsStuck/>" * {"RateController": 1, "RecoveryNode": 2}.get(node, 0)
        for number in numbers:
            body = f'<{node} {name}="{number}">{children}</{node}>'
            found = check(forest(body), REGISTRIES["kilted"])
            [finding] = [each for each in found if each.code == "out-of-range"]
            assert (finding.severity, finding.hint) == (Severity.WARNING, f"write a number {bounds}")

    def test_unit_of_port_matches_its_description(self):
        phrases = {
            "s": "in seconds",
            "rad": "in radians",
            "m": "in metres",
            "m/s": "in metres per second",
            "hz": "in hertz",
        }
        known = {name: unit for unit, names in facts()["units"].items() for name in names}
        for name, doc in facts()["ports"].items():
            units = [unit for unit, words in phrases.items() if re.search(rf"{words}\b(?! per)", doc)]
            assert known.get(name, "") in (units or [""]), name

    @pytest.mark.parametrize("version", DISTRIBUTIONS)
    def test_every_default_is_plausible(self, version):
        for spec in load_palettes([f"nav2:{version}"]):
            for each in spec.attributes:
                if each.value_type.usual is not None and each.default is not None:
                    assert each.default in each.value_type.usual, (spec.tag, each.name)


class TestValues:
    @pytest.mark.parametrize(
        "body",
        [
            '<ComputePathToPose goal="0;map;1;2;0;0;0;0;1"/>',
            '<ComputePathToPose goal="json:{}"/>',
            '<ComputePathToPose server_timeout="20"/>',
            '<ComputePathToPose server_timeout="20ms"/>',
            '<ComputePathThroughPoses goals="0;map;1;2;0;0;0;0;1;0;map;1;2;0;0;0;0;1"/>',
            '<FollowPath path="0;map"/>',
            '<WouldAPlannerRecoveryHelp error_codes_to_check="1;2"/>',
        ],
    )
    def test_value_that_nav2_can_convert_is_accepted(self, body):
        assert error_messages(body) == []

    @pytest.mark.parametrize(
        ("body", "message"),
        [
            (
                '<ComputePathToPose goal="1;2;0"/>',
                "goal: '1;2;0' is not a pose: it has 3 fields",
            ),
            (
                '<ComputePathToPose goal="0;map;1;2;0;0;0;0;x"/>',
                "goal: 'x' is not a number",
            ),
            (
                '<ComputePathToPose server_timeout="2s"/>',
                "server_timeout: '2s' is not a number of milliseconds",
            ),
            (
                '<ComputePathToPose goal="{g}" path="{g}"/>',
                "path: 'g' is a path here, but a pose for goal of 'ComputePathToPose' (line 3)",
            ),
        ],
    )
    def test_value_that_nav2_rejects_is_reported(self, body, message):
        assert error_messages(body) == [message]


class TestNames:
    @pytest.mark.parametrize("name", ["nav2:jazzy", "nav2:", "my_robot:1.2"])
    def test_palette_name_contains_colon_and_optional_version(self, name):
        assert is_palette_name(name)

    @pytest.mark.parametrize("path", ["nodes.xml", "./nav2:jazzy", "C:nodes.xml", "a/b:c"])
    def test_path_is_no_palette_name(self, path):
        assert not is_palette_name(path)

    @pytest.mark.parametrize(
        ("name", "message"),
        [
            (
                "nav2:jazy",
                "there is no palette 'nav2:jazy', did you mean 'nav2:jazzy'? (installed: nav2:jazzy, nav2:kilted, nav2:main)",
            ),
            ("nav:jazzy", "there is no palette 'nav:jazzy', did you mean 'nav2:...'? (installed: nav2:..."),
        ],
    )
    def test_unknown_palette_is_reported_with_installed_ones(self, name, message):
        with pytest.raises(PaletteError, match=re.escape(message)):
            load_palettes([name])

    def test_first_of_two_versions_is_used(self):
        specs = load_palettes(["nav2:main", "nav2:jazzy"])
        assert {spec.tag for spec in specs} == tags_of("main")


@register("FollowPath", kind=Kind.ACTION)
class FollowPath(SkippableLeaf):
    """A leaf of the user with the same name as a node of Nav2."""


class TestProject:
    def test_registered_leaf_takes_precedence_over_palette(self):
        registry = load_registry([FollowPath], palettes=["nav2:jazzy"])
        assert registry["FollowPath"].cls is FollowPath

    def test_palette_version_of_user_takes_precedence_over_configuration(self, tmp_path):
        path = tmp_path / "tree.xml"
        path.write_text(document("<IsPathValid/>"), encoding="utf-8")
        (tmp_path / "sar.toml").write_text('models = ["nav2:jazzy"]\n', encoding="utf-8")
        assert [finding.code for finding in load(path).check()] == []
        assert [finding.code for finding in load(path, models=["nav2:main"]).check()] == ["unknown-node"]


class TestRuns:
    """Runs of trees of Nav2's nodes without Nav2."""

    def tree(self, tmp_path, body, version="jazzy"):
        path = tmp_path / "tree.xml"
        path.write_text(document(body), encoding="utf-8")
        return load(path, models=[f"nav2:{version}"])

    REPLANNING = (
        '<PipelineSequence><DistanceController><ComputePathToPose path="{path}"/></DistanceController>'
        '<FollowPath path="{path}"/></PipelineSequence>'
    )

    def test_simulation_uses_given_outcomes(self, tmp_path):
        world = {"DistanceController": ["driven", "on the way", "driven"], "FollowPath": ["RUNNING"] * 3}
        simulated = self.tree(tmp_path, self.REPLANNING).simulate(leaves=world)
        planned = [simulated.tick().trace.count("ComputePathToPose") for _ in range(3)]
        assert planned == [1, 1, 2]

    def test_verification_tries_all_outcomes_of_stand_in(self, tmp_path):
        verification = self.tree(tmp_path, self.REPLANNING).verify()
        assert verification.is_proved
        asked = next(leaf for leaf in verification.leaves if leaf.name == "DistanceController")
        assert [answer.label for answer in asked.outcomes] == ["driven", "on the way", "no pose"]

    @pytest.mark.parametrize(
        ("version", "attribute", "end"),
        [
            ("jazzy", "", "SUCCESS"),
            ("kilted", "", "SUCCESS"),
            ("main", "", "FAILURE"),
            ("main", ' wrap_around="true"', "SUCCESS"),
        ],
    )
    def test_round_robin_without_wrap_around_fails_with_last_child(self, tmp_path, version, attribute, end):
        body = f"<RoundRobin{attribute}><AlwaysFailure/><IsStuck/></RoundRobin>"
        assert self.tree(tmp_path, body, version).simulate(IsStuck="SUCCESS").tick().root == end

    def test_recovery_runs_only_after_failure(self, tmp_path):
        body = "<RecoveryNode><ComputePathToPose/><ClearEntireCostmap/></RecoveryNode>"
        simulated = self.tree(tmp_path, body).simulate(ComputePathToPose=["FAILURE", "SUCCESS"])
        assert simulated.tick().root == "SUCCESS"
        assert "ClearEntireCostmap" in simulated.trace
        assert "ClearEntireCostmap" not in self.tree(tmp_path, body).simulate().tick().trace

    def test_compiling_reports_nodes_without_class(self, tmp_path):
        body = "<RecoveryNode><RateController><AlwaysSuccess/></RateController><Spin/></RecoveryNode>"
        with pytest.raises(TreeError, match="<Spin> is a node of another program") as caught:
            self.tree(tmp_path, body).compile()
        assert [finding.code for finding in caught.value.findings] == ["not-installed"]

    def test_controls_and_decorators_of_nav2_run_without_nav2(self, tmp_path):
        body = (
            "<RecoveryNode><RateController><AlwaysFailure/></RateController><AlwaysSuccess/></RecoveryNode>"
        )
        compiled = self.tree(tmp_path, body).compile()
        compiled.root.tick_once()
        assert compiled.root.status is Status.FAILURE


def test_palette_that_is_only_in_current_folder_is_not_loaded(tmp_path, monkeypatch):
    metadata = tmp_path / "gripper-1.dist-info"
    metadata.mkdir()
    (metadata / "METADATA").write_text("Metadata-Version: 2.1\nName: gripper\nVersion: 1\n", encoding="utf-8")
    text = "[sar_compiler.palettes]\ngripper = gripper_palette\n"
    (metadata / "entry_points.txt").write_text(text, encoding="utf-8")
    (tmp_path / "gripper_palette.py").write_text("raise SystemExit", encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(tmp_path)
    with pytest.raises(PaletteError, match=r"there is no palette 'gripper:1' \(installed: nav2"):
        load_palettes(["gripper:1"])
