"""One way from a tree file to everything about it, for commands, programs and tests."""

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

NEEDLESS = document("<Sequence><Success/></Sequence>")
SLEEPS = document('<Sleep msec="100"/>')


@register("Timed", kind=Kind.ACTION, outcomes={Status.SUCCESS})
class Timed(Behaviour):
    """Keeps what it is given.

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
    """Derived from a leaf, but none itself."""


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
    def test_a_shipped_tree_goes_by_its_name(self):
        assert load("search_and_rescue").check() == []

    def test_a_file_that_is_not_there_is_said_at_once(self, folder):
        with pytest.raises(UnreadableFileError, match=r"cannot read nowhere\.xml"):
            load("nowhere.xml")

    def test_what_is_malformed_is_a_finding_and_nothing_can_be_made_of_it(self, folder):
        tree = load(write(folder, "<root"))
        assert [each.code for each in tree.check()] == ["malformed-xml"]
        assert tree.tree_file is None
        assert tree.source.text == "<root"
        for use in (tree.compile, tree.preview, tree.simulate, tree.verify):
            with pytest.raises(TreeError, match="malformed-xml"):
                use()

    def test_it_shows_itself_by_its_file(self, folder):
        write(folder, SLEEPS)
        assert repr(load("tree.xml")) == "<LoadedTree tree.xml>"

    def test_an_open_text_takes_the_place_of_the_file(self, folder):
        path = write(folder, "<root")
        workspace = Workspace(read=lambda path: parse_xml(SLEEPS, str(path)))
        assert workspace.load(path).check() == []

    @pytest.mark.parametrize("nodes", [leaves, leaves.Say, "tests.nodes.leaves"])
    def test_leaves_are_named_as_classes_as_modules_and_by_their_import_paths(self, folder, nodes):
        tree = load(write(folder, document('<Say message="hi"/>')), nodes=[nodes])
        assert tree.check() == []

    def test_a_class_that_is_not_registered_itself_is_named(self, folder):
        with pytest.raises(RegistryError, match="Unmarked is not registered: write @register above"):
            load(write(folder, SLEEPS), nodes=[Unmarked]).check()

    @pytest.mark.parametrize("argument", ["nodes", "models", "include_path"])
    def test_one_text_in_place_of_several_is_explained(self, argument):
        with pytest.raises(
            TypeError, match=rf"^{argument} is the string 'x'\. Pass a list of strings: {argument}=\['x'\]$"
        ):
            load("search_and_rescue", **{argument: "x"})  # type: ignore[arg-type]

    def test_palettes_and_folders_are_added(self, folder):
        palette = write(
            folder, '<root><TreeNodesModel><Action ID="Fly"/></TreeNodesModel></root>', "palette.xml"
        )
        write(folder, document("<Fly/>", main="B"), "shared/b.xml")
        text = document('<SubTree ID="B"/>').replace("<Beh", '<include path="../shared/b.xml"/><Beh')
        path = write(folder, text.replace("<root", '<root main_tree_to_execute="Main"'), "trees/a.xml")
        added = load(path, models=[str(palette)], include_path=[str(folder / "shared")], isolated=True)
        assert added.check() == []
        assert {each.code for each in load(path, isolated=True).check()} == {"include-outside"}

    def test_what_is_wrong_with_a_palette_is_part_of_what_is_wrong(self, folder):
        text = '<root><TreeNodesModel><Action ID="Sequence"/></TreeNodesModel></root>'
        palette = write(folder, text, "palette.xml")
        tree = load(write(folder, SLEEPS), models=[palette])
        assert [each.code for each in tree.check()] == ["model-mismatch"]
        assert tree.compile().root.name == "Sleep"


class TestProjects:
    def test_files_of_one_configuration_share_what_it_decides(self, folder):
        write(folder, "nodes = []\n", "sar.toml")
        workspace = Workspace()
        one, two = (workspace.load(write(folder, SLEEPS, f"{name}/tree.xml")) for name in ("one", "two"))
        assert one.project is two.project
        assert one.project.registry is two.project.registry

    def test_files_of_two_configurations_do_not(self, folder):
        write(folder, '[findings]\nneedless-node = "off"\n', "one/sar.toml")
        workspace = Workspace()
        one, two = (workspace.load(write(folder, NEEDLESS, f"{name}/tree.xml")) for name in ("one", "two"))
        assert [len(each.check()) for each in (one, two)] == [0, 1]

    def test_a_note_is_said_once(self, folder):
        said: list[str] = []
        workspace = Workspace(note=said.append)
        workspace.report_once("once")
        workspace.report_once("once")
        assert said == ["once"]

    @pytest.mark.skipif(os.geteuid() != 0, reason="only root gives files away")
    def test_a_program_is_warned_of_what_is_passed_over(self, folder):
        os.chown(write(folder, "x = 1\n", "sar.toml"), 1234, 1234)
        write(folder, SLEEPS)
        with pytest.warns(UserWarning, match=r"sar\.toml is ignored"):
            assert load("tree.xml").check() == []

    def test_what_the_user_adds_comes_before_the_configuration_s(self, folder):
        write(folder, 'models = ["b.xml"]\ninclude-path = ["b"]\n', "sar.toml")
        project = (
            Workspace(CommandLineSettings(include_path=(Path("a"),))).load(write(folder, SLEEPS)).project
        )
        assert project.include_path == (Path("a"), folder / "b", folder)


class TestSettings:
    @pytest.fixture
    def strict(self, folder):
        write(folder, '[findings]\nneedless-node = "error"\n', "sar.toml")
        return str(write(folder, NEEDLESS))

    def test_count_for_a_program(self, strict):
        (finding,) = load(strict).check()
        assert (finding.code, finding.severity) == ("needless-node", Severity.ERROR)
        with pytest.raises(TreeError, match="needless-node"):
            load(strict).compile()

    @pytest.mark.parametrize("command", ["validate", "show", "simulate", "verify"])
    def test_count_for_every_command(self, strict, capsys, command):
        assert main([command, strict]) != 0
        said = capsys.readouterr()
        assert "error[needless-node]" in said.out + said.err

    def test_count_for_tests(self, strict):
        for use in (compile_for_test, simulate):
            with pytest.raises(TreeError, match="needless-node"):
                use(strict)


class TestCompiling:
    def test_an_empty_mission_has_the_time(self, folder):
        tree = load(write(folder, document("<Timed/>")), nodes=[Timed]).compile()
        assert isinstance(tree.root, Timed)
        assert isinstance(tree.root.clock, WallClock)

    def test_what_is_handed_over_is_used(self, folder):
        clock = ManualClock()
        tree = load(write(folder, SLEEPS)).compile(context={Clock: clock})
        tree.root.tick_once()
        clock.advance(0.1)
        tree.root.tick_once()
        assert tree.root.status == Status.SUCCESS

    def test_parameters_are_keys_of_the_tree(self, folder):
        path = write(folder, document('<Timed rounds="{@n}"/>'))
        tree = load(path, nodes=[Timed]).compile(parameters={"n": 3})
        assert isinstance(tree.root, Timed)
        assert tree.root.rounds == 3

    def test_a_tree_of_several_goes_by_its_id(self, folder):
        two = document("<Success/>", "A").replace(
            "</root>", '<BehaviorTree ID="B"><Failure/></BehaviorTree></root>'
        )
        tree = load(write(folder, two))
        assert tree.compile(tree_id="B").root.name == "Failure"
        with pytest.raises(TreeError, match="no-main-tree"):
            tree.compile()

    @pytest.mark.ros
    def test_a_node_gives_its_clock_and_its_parameters(self, folder):
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
        # Nobody publishes /clock.
        assert one.clock.now() == 0.0
        context.try_shutdown()

    @pytest.mark.ros
    def test_a_runner_takes_a_compiled_tree_or_its_root(self, folder):
        tree = load(write(folder, SLEEPS)).compile()
        assert sar_compiler.TreeRunner(tree).root is sar_compiler.TreeRunner(tree.root).root is tree.root

    def test_a_compiled_tree_shows_itself_as_an_outline(self, folder):
        body = '<Sequence name="All">' + "".join(f'<Success name="s{n}"/>' for n in range(40)) + "</Sequence>"
        lines = repr(load(write(folder, document(body))).compile()).splitlines()
        assert lines[0] == "<CompiledTree of 41 nodes>"
        assert lines[1].strip() == "{-} All"
        assert len(lines) == 26
        assert lines[-2:] == ["        --> s22", "        ..."]


class TestRuns:
    def test_all_runs_are_gone_through_from_the_facts_that_are_said(self):
        tree = load("search_and_rescue")
        small, large = (tree.verify(facts={"zones_left": zones}) for zones in (1, 2))
        assert small.states < large.states

    def test_a_mistake_in_the_facts_is_a_finding(self):
        with pytest.raises(
            TreeError, match=r"(?s)facts:1:1: error\[unknown-fact\].*did you mean 'zones_left'"
        ):
            load("search_and_rescue").verify(facts={"zone_left": 1})

    def test_a_file_of_properties_is_held(self, folder):
        properties = write(folder, "properties:\n  never there: {never: NavigateToBase arrived}\n", "p.yaml")
        verification = load("search_and_rescue").verify(properties, facts={"zones_left": 1})
        assert [each.question for each in verification.verdicts if each.question == "never there"] == [
            "never there"
        ]
        assert not verification.is_proved

    def test_shipped_trees_go_by_their_names_in_tests_too(self, folder):
        assert compile_for_test("search_and_rescue").root.name == "MissionOrReturnToBase"
        scenario = write(folder, "leaves: {DetectSurvivor: found}\nexpect: {root: SUCCESS}\n", "s.yaml")
        assert_scenario_holds("search_and_rescue", scenario)

    def test_leaves_of_one_s_own_are_named_in_tests_too(self, folder):
        path = write(folder, document("<Timed/>"))
        assert compile_for_test(path, nodes=[Timed]).root.name == "Timed"
        assert simulate(path, nodes=[Timed]).tick().root == "SUCCESS"


def test_what_a_command_prints_is_what_a_program_gets(capsys):
    assert main(["show", "search_and_rescue", "--format", "json"]) == 0
    shown = json.loads(capsys.readouterr().out)
    assert shown["name"] == load("search_and_rescue").preview().root.name
    assert isinstance(load("search_and_rescue").preview().root, py_trees.composites.Selector)


def test_a_notebook_draws_each_tree_that_can_be_parsed(tmp_path):
    assert (load("search_and_rescue")._repr_svg_() or "").startswith("<svg ")
    assert "? Nope" in (load(write(tmp_path, document("<Nope/>")))._repr_svg_() or "")
    assert load(write(tmp_path, "<root>"))._repr_svg_() is None


def test_a_script_may_use_a_list_twice_and_statuses_of_py_trees():
    once = [Status.FAILURE, "arrived"]
    run = simulate("search_and_rescue", NavigateToZone=once, NavigateToBase=once).tick()
    run.expect(root=Status.FAILURE, order=["NavigateToZone aborted", "NavigateToBase aborted"])


@pytest.mark.parametrize("answer", [object(), {"aborted"}, [b"aborted"]])
def test_what_no_script_can_have_is_named(answer):
    with pytest.raises(sar_compiler.SarError, match=r"cannot be part of the script: use strings"):
        simulate("search_and_rescue", NavigateToZone=answer)
