"""Tests of `load`, with which commands, programs and tests load, check, compile and verify a tree file."""

import json
import os
from pathlib import Path

import py_trees
import pytest
from py_trees.behaviour import Behaviour
from py_trees.common import Status

import sar_compiler
from sar_compiler import RegistryError, Severity, TreeError, UnreadableFileError, load
from sar_compiler.cli.compile import main
from sar_compiler.leaves import Clock, Kind, register
from sar_compiler.project import CommandLineSettings, Workspace
from sar_compiler.runtime.clock import ManualClock, WallClock
from sar_compiler.testing import assert_scenario_holds, compile_for_test, simulate
from sar_compiler.tree.xml import parse_xml
from tests.nodes import leaves
from tests.trees import document

TREE_WITH_NEEDLESS_NODE = document("<Sequence><Success/></Sequence>")
TREE_WITH_SLEEP = document('<Sleep msec="100"/>')


@register("Timed", kind=Kind.ACTION, outcomes={Status.SUCCESS})
class Timed(Behaviour):
    """Stores its arguments.

    Args:
        name: The node's name.
        clock: The time.
        rounds: A number.
    """

    def __init__(self, name: str, clock: Clock, rounds: int = 0) -> None:
        super().__init__(name)
        self.clock, self.rounds = clock, rounds

    def update(self) -> Status:
        return Status.SUCCESS


class Unmarked(Timed):
    """A subclass of a registered leaf, which is not registered itself."""


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


def write(folder, text, name="tree.xml"):
    path = folder / name
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text, encoding="utf-8")
    return path


class TestLoading:
    def test_shipped_tree_is_loaded_by_name(self):
        assert load("search_and_rescue").check() == []

    def test_missing_file_raises_error_when_loaded(self, folder):
        with pytest.raises(UnreadableFileError, match=r"cannot read nowhere\.xml"):
            load("nowhere.xml")

    def test_malformed_file_has_finding_and_cannot_be_used(self, folder):
        tree = load(write(folder, "<root"))
        assert [each.code for each in tree.check()] == ["malformed-xml"]
        assert tree.tree_file is None
        assert tree.source.text == "<root"
        for use in (tree.compile, tree.preview, tree.simulate, tree.verify):
            with pytest.raises(TreeError, match="malformed-xml"):
                use()

    def test_repr_of_loaded_tree_shows_its_file(self, folder):
        write(folder, TREE_WITH_SLEEP)
        assert repr(load("tree.xml")) == "<LoadedTree tree.xml>"

    def test_workspace_can_read_open_text_in_place_of_file(self, folder):
        path = write(folder, "<root")
        workspace = Workspace(read=lambda path: parse_xml(TREE_WITH_SLEEP, str(path)))
        assert workspace.load(path).check() == []

    @pytest.mark.parametrize("nodes", [leaves, leaves.Say, "tests.nodes.leaves"])
    def test_leaves_may_be_given_as_classes_modules_or_import_paths(self, folder, nodes):
        tree = load(write(folder, document('<Say message="hi"/>')), nodes=[nodes])
        assert tree.check() == []

    def test_unregistered_class_raises_error_with_its_name(self, folder):
        with pytest.raises(RegistryError, match="Unmarked is not registered: write @register above"):
            load(write(folder, TREE_WITH_SLEEP), nodes=[Unmarked]).check()

    @pytest.mark.parametrize("argument", ["nodes", "models", "include_path"])
    def test_string_in_place_of_list_of_strings_is_rejected(self, argument):
        with pytest.raises(
            TypeError, match=rf"^{argument} is the string 'x'\. Pass a list of strings: {argument}=\['x'\]$"
        ):
            load("search_and_rescue", **{argument: "x"})  # type: ignore[arg-type]

    def test_palettes_and_include_folders_can_be_added(self, folder):
        palette = write(
            folder, '<root><TreeNodesModel><Action ID="Fly"/></TreeNodesModel></root>', "palette.xml"
        )
        write(folder, document("<Fly/>", main="B"), "shared/b.xml")
        text = document('<SubTree ID="B"/>').replace("<Beh", '<include path="../shared/b.xml"/><Beh')
        path = write(folder, text.replace("<root", '<root main_tree_to_execute="Main"'), "trees/a.xml")
        added = load(path, models=[str(palette)], include_path=[str(folder / "shared")], isolated=True)
        assert added.check() == []
        assert {each.code for each in load(path, isolated=True).check()} == {"include-outside"}

    def test_check_includes_findings_of_palettes(self, folder):
        text = '<root><TreeNodesModel><Action ID="Sequence"/></TreeNodesModel></root>'
        palette = write(folder, text, "palette.xml")
        tree = load(write(folder, TREE_WITH_SLEEP), models=[palette])
        assert [each.code for each in tree.check()] == ["model-mismatch"]
        assert tree.compile().root.name == "Sleep"


class TestProjects:
    def test_files_with_same_configuration_share_project(self, folder):
        write(folder, "nodes = []\n", "sar.toml")
        workspace = Workspace()
        one, two = (
            workspace.load(write(folder, TREE_WITH_SLEEP, f"{name}/tree.xml")) for name in ("one", "two")
        )
        assert one.project is two.project
        assert one.project.registry is two.project.registry

    def test_files_with_different_configurations_have_different_settings(self, folder):
        write(folder, '[findings]\nneedless-node = "off"\n', "one/sar.toml")
        workspace = Workspace()
        one, two = (
            workspace.load(write(folder, TREE_WITH_NEEDLESS_NODE, f"{name}/tree.xml"))
            for name in ("one", "two")
        )
        assert [len(each.check()) for each in (one, two)] == [0, 1]

    def test_note_is_reported_once(self, folder):
        said: list[str] = []
        workspace = Workspace(note=said.append)
        workspace.report_once("once")
        workspace.report_once("once")
        assert said == ["once"]

    @pytest.mark.skipif(os.geteuid() != 0, reason="only root gives files away")
    def test_program_is_warned_about_ignored_configuration(self, folder):
        os.chown(write(folder, "x = 1\n", "sar.toml"), 1234, 1234)
        write(folder, TREE_WITH_SLEEP)
        with pytest.warns(UserWarning, match=r"sar\.toml is ignored"):
            assert load("tree.xml").check() == []

    def test_include_path_of_user_precedes_that_of_configuration(self, folder):
        write(folder, 'models = ["b.xml"]\ninclude-path = ["b"]\n', "sar.toml")
        project = (
            Workspace(CommandLineSettings(include_path=(Path("a"),)))
            .load(write(folder, TREE_WITH_SLEEP))
            .project
        )
        assert project.include_path == (Path("a"), folder / "b", folder)


class TestSettings:
    @pytest.fixture
    def strict(self, folder):
        write(folder, '[findings]\nneedless-node = "error"\n', "sar.toml")
        return str(write(folder, TREE_WITH_NEEDLESS_NODE))

    def test_settings_apply_to_programs(self, strict):
        (finding,) = load(strict).check()
        assert (finding.code, finding.severity) == ("needless-node", Severity.ERROR)
        with pytest.raises(TreeError, match="needless-node"):
            load(strict).compile()

    @pytest.mark.parametrize("command", ["validate", "show", "simulate", "verify"])
    def test_settings_apply_to_every_command(self, strict, capsys, command):
        assert main([command, strict]) != 0
        said = capsys.readouterr()
        assert "error[needless-node]" in said.out + said.err

    def test_settings_apply_to_test_helpers(self, strict):
        for use in (compile_for_test, simulate):
            with pytest.raises(TreeError, match="needless-node"):
                use(strict)


class TestCompiling:
    def test_clock_is_wall_clock_by_default(self, folder):
        tree = load(write(folder, document("<Timed/>")), nodes=[Timed]).compile()
        assert isinstance(tree.root, Timed)
        assert isinstance(tree.root.clock, WallClock)

    def test_given_context_is_used(self, folder):
        clock = ManualClock()
        tree = load(write(folder, TREE_WITH_SLEEP)).compile(context={Clock: clock})
        tree.root.tick_once()
        clock.advance(0.1)
        tree.root.tick_once()
        assert tree.root.status == Status.SUCCESS

    def test_parameters_are_keys_of_tree(self, folder):
        path = write(folder, document('<Timed rounds="{@n}"/>'))
        tree = load(path, nodes=[Timed]).compile(parameters={"n": 3})
        assert isinstance(tree.root, Timed)
        assert tree.root.rounds == 3

    def test_main_tree_is_selected_by_id(self, folder):
        two = document("<Success/>", "A").replace(
            "</root>", '<BehaviorTree ID="B"><Failure/></BehaviorTree></root>'
        )
        tree = load(write(folder, two))
        assert tree.compile(tree_id="B").root.name == "Failure"
        with pytest.raises(TreeError, match="no-main-tree"):
            tree.compile()

    @pytest.mark.ros
    def test_clock_and_parameters_of_ros_node_are_used(self, folder):
        import rclpy
        from rclpy.context import Context
        from rclpy.node import Node
        from rclpy.parameter import Parameter

        context = Context()
        rclpy.init(context=context)
        node = Node("robot", context=context, parameter_overrides=[Parameter("use_sim_time", value=True)])
        node.declare_parameter("n", 3)
        node.declare_parameter("m", 4)
        text = document('<Sequence><Timed rounds="{@n}"/><Timed name="other" rounds="{@m}"/></Sequence>')
        tree = load(write(folder, text), nodes=[Timed]).compile(node=node, parameters={"m": 5})
        one, other = (child for child in tree.root.children if isinstance(child, Timed))
        assert (one.rounds, other.rounds) == (3, 5)
        # No node publishes /clock.
        assert one.clock.now() == 0.0
        context.try_shutdown()

    @pytest.mark.ros
    def test_tree_runner_accepts_compiled_tree_or_its_root(self, folder):
        tree = load(write(folder, TREE_WITH_SLEEP)).compile()
        assert sar_compiler.TreeRunner(tree).root is sar_compiler.TreeRunner(tree.root).root is tree.root

    def test_repr_of_compiled_tree_is_outline(self, folder):
        body = '<Sequence name="All">' + "".join(f'<Success name="s{n}"/>' for n in range(40)) + "</Sequence>"
        lines = repr(load(write(folder, document(body))).compile()).splitlines()
        assert lines[0] == "<CompiledTree of 41 nodes>"
        assert lines[1].strip() == "{-} All"
        assert len(lines) == 26
        assert lines[-2:] == ["        --> s22", "        ..."]


class TestVerificationAndTesting:
    def test_verification_starts_from_given_facts(self):
        tree = load("search_and_rescue")
        small, large = (tree.verify(facts={"zones_left": zones}) for zones in (1, 2))
        assert small.states < large.states

    def test_unknown_fact_is_reported(self):
        with pytest.raises(
            TreeError, match=r"(?s)facts:1:1: error\[unknown-fact\].*did you mean 'zones_left'"
        ):
            load("search_and_rescue").verify(facts={"zone_left": 1})

    def test_properties_of_file_are_verified(self, folder):
        properties = write(folder, "properties:\n  never there: {never: NavigateToBase arrived}\n", "p.yaml")
        verification = load("search_and_rescue").verify(properties, facts={"zones_left": 1})
        assert [each.question for each in verification.verdicts if each.question == "never there"] == [
            "never there"
        ]
        assert not verification.is_proved

    def test_test_helpers_accept_names_of_shipped_trees(self, folder):
        assert compile_for_test("search_and_rescue").root.name == "MissionOrReturnToBase"
        scenario = write(folder, "leaves: {DetectSurvivor: found}\nexpect: {root: SUCCESS}\n", "s.yaml")
        assert_scenario_holds("search_and_rescue", scenario)

    def test_test_helpers_accept_user_leaves(self, folder):
        path = write(folder, document("<Timed/>"))
        assert compile_for_test(path, nodes=[Timed]).root.name == "Timed"
        assert simulate(path, nodes=[Timed]).tick().root == "SUCCESS"


def test_show_command_prints_same_tree_as_preview(capsys):
    assert main(["show", "search_and_rescue", "--format", "json"]) == 0
    shown = json.loads(capsys.readouterr().out)
    assert shown["name"] == load("search_and_rescue").preview().root.name
    assert isinstance(load("search_and_rescue").preview().root, py_trees.composites.Selector)


def test_notebook_draws_every_tree_that_can_be_parsed(tmp_path):
    assert (load("search_and_rescue")._repr_svg_() or "").startswith("<svg ")
    assert "? Nope" in (load(write(tmp_path, document("<Nope/>")))._repr_svg_() or "")
    assert load(write(tmp_path, "<root>"))._repr_svg_() is None


def test_simulation_script_may_reuse_list_and_contain_statuses():
    once = [Status.FAILURE, "arrived"]
    run = simulate("search_and_rescue", NavigateToZone=once, NavigateToBase=once).tick()
    run.expect(root=Status.FAILURE, order=["NavigateToZone aborted", "NavigateToBase aborted"])


@pytest.mark.parametrize("answer", [object(), {"aborted"}, [b"aborted"]])
def test_invalid_object_in_simulation_script_is_rejected(answer):
    with pytest.raises(sar_compiler.SarError, match=r"cannot be part of the script: use strings"):
        simulate("search_and_rescue", NavigateToZone=answer)
