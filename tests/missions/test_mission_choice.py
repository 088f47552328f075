"""Tests of the choice of the mission for a tree."""

import re

import pytest

from sar_compiler.compiler import bind_main
from sar_compiler.missions.mission_choice import MissionError, choose_mission, find_mission, load_missions
from sar_compiler.missions.parameter_reader import ParameterReader
from sar_compiler.nodes.registry import load_registry
from sar_compiler.tree.diagnostic import TreeError
from search_and_rescue.plugin import MISSION
from tests.trees import forest

SOURCE = """
from py_trees.behaviour import Behaviour
from sar_compiler.missions.mission import Mission, MissionRun
from sar_compiler.leaves import Kind, register
from sar_compiler.runtime.context import mission_context

@mission_context
class Crop: pass

@register("Water", kind=Kind.ACTION)
class Water(Behaviour):
    def __init__(self, name: str, crop: Crop) -> None:
        super().__init__(name)

class Farm(Mission):
    name = "farming"
    context_types = (Crop,)

    def begin(self, reader):
        return MissionRun()

FARM, OTHER, UNNAMED, LOOSE = Farm(), Farm(), Farm(), Farm()
class Drought(MissionRun):
    def summary(self, elapsed_sec, ticks):
        return 1 / 0

class DryFarm(Farm):
    def begin(self, reader):
        return reader.parameters and Drought()

DRY = DryFarm()
UNNAMED.name = "my farm"
LOOSE.context_types = Crop
"""


@pytest.fixture
def install(tmp_path, monkeypatch):
    """Install a package as pip does, for one test: its module and its entry points."""

    def install_package(module, *entries):
        (tmp_path / f"{module}.py").write_text(SOURCE, encoding="utf-8")
        metadata = tmp_path / f"{module}-1.0.dist-info"
        metadata.mkdir()
        lines = ["[sar_compiler.missions]", *(f"entry{n} = {entry}" for n, entry in enumerate(entries))]
        (metadata / "entry_points.txt").write_text("\n".join(lines), encoding="utf-8")
        monkeypatch.syspath_prepend(tmp_path)

    return install_package


def mission_name(mission):
    assert mission is not None
    return mission.name


def bind_tree(body, *modules):
    return bind_main(forest(body), load_registry(modules))


@pytest.mark.parametrize(
    "body", ["<NavigateToBase/>", "<DeliverReports/>", "<Sequence><Success/><ZonesRemaining/></Sequence>"]
)
def test_mission_is_chosen_by_context_of_leaves(body):
    assert mission_name(choose_mission(bind_tree(body))) == MISSION.name


def test_tree_without_mission_context_has_no_mission():
    assert choose_mission(bind_tree("<Sequence><Sleep msec='5'/><Success/></Sequence>")) is None


def test_mission_of_another_package_is_found(install):
    install("farm_a", "farm_a:FARM")
    assert sorted(load_missions()) == ["farming", "search_and_rescue"]
    assert mission_name(choose_mission(bind_tree("<Water/>", "farm_a"))) == "farming"


def test_leaves_of_two_missions_are_an_error_with_location(install):
    install("farm_b", "farm_b:FARM")
    tree = bind_tree("<Sequence><AdvanceZone/><Water/><ZonesRemaining/></Sequence>", "farm_b")
    with pytest.raises(TreeError) as caught:
        choose_mission(tree)
    [finding] = caught.value.findings
    assert finding.code == "several-missions"
    assert finding.message == (
        "the leaves of this tree belong to several missions: <AdvanceZone> of 'search_and_rescue', "
        "<Water> of 'farming'"
    )
    assert finding.hint == "choose one with --mission NAME"
    assert (finding.span.line, finding.span.column) == (3, 25)


def test_mission_name_overrides_context_of_leaves(install):
    install("farm_c", "farm_c:FARM")
    tree = bind_tree("<Sequence><AdvanceZone/><Water/></Sequence>", "farm_c")
    assert mission_name(choose_mission(tree, "search_and_rescue")) == MISSION.name
    assert mission_name(choose_mission(bind_tree("<Success/>"), "search_and_rescue")) == MISSION.name


def test_unknown_mission_name_suggests_similar_one():
    said = "there is no mission 'search_and_rescu' (installed: search_and_rescue); did you mean 'search_and_rescue'?"
    with pytest.raises(MissionError, match=f"^{re.escape(said)}$"):
        find_mission("search_and_rescu")


def test_uninstalled_mission_in_checkout_is_reported_as_ignored(install, tmp_path):
    install("farm_f", "farm_f:FARM")
    with pytest.raises(MissionError, match=f"The missions in {re.escape(str(tmp_path))} are ignored"):
        find_mission("farming", tmp_path)


@pytest.mark.parametrize(
    ("entries", "problem"),
    [
        (
            ["nowhere_at_all:X"],
            "'nowhere_at_all:X' (entry point 'entry0') cannot be imported: ModuleNotFoundError",
        ),
        (["farm_d:NOT_THERE"], "cannot be imported: AttributeError"),
        (
            ["farm_d:Crop"],
            "'farm_d:Crop' (entry point 'entry0') must name a Mission, but names <class 'farm_d.Crop'>",
        ),
        (
            ["farm_d:UNNAMED"],
            "must have a name that is valid for a node, such as 'patrol', but has 'my farm'",
        ),
        (
            ["farm_d:LOOSE"],
            "must have a collection of classes as context_types, but has <class 'farm_d.Crop'>",
        ),
        (
            ["farm_d:FARM", "farm_d:OTHER"],
            "two installed missions have the name 'farming'. One of them is the mission 'farm_d:OTHER'",
        ),
    ],
)
def test_invalid_mission_entry_point_is_reported(install, entries, problem):
    install("farm_d", *entries)
    with pytest.raises(MissionError, match=re.escape(problem)):
        load_missions()


def test_exception_in_mission_names_mission_and_location(install):
    install("farm_e", "farm_e:DRY")
    mission = choose_mission(bind_tree("<Success/>"), "farming")
    assert mission is not None
    said = (
        r"^the mission 'farming' failed in summary: ZeroDivisionError: division by zero \(.*farm_e\.py:\d+\)$"
    )
    with pytest.raises(MissionError, match=said):
        mission.begin(ParameterReader({"x": 1})).summary(0.0, 0)
    with pytest.raises(
        MissionError, match=r"failed in begin: the method returned \{\} instead of a MissionRun"
    ):
        mission.begin(ParameterReader({}))
