"""Tests of simulated trees: real controls, with stub leaves that return chosen outcomes."""

import pytest
from py_trees import behaviours, composites
from py_trees.behaviour import Behaviour
from py_trees.common import Status
from py_trees.decorators import Decorator

from sar_compiler.analysis.simulated_tree import (
    Assumptions,
    UnknownBehaviourError,
    compile_simulated,
    match_rank,
    replace_nodes,
)
from sar_compiler.analysis.stub_leaf import StubLeaf
from sar_compiler.compiler import bind_main
from sar_compiler.leaves import Kind, Outcome, register
from sar_compiler.nodes.registry import Registry, default_registry
from sar_compiler.nodes.spec import MARK
from sar_compiler.runtime.kernel.timing import SleepNode
from sar_compiler.tree.diagnostic import TreeError
from tests.nodes.leaves import Radio
from tests.trees import document, forest, forest_of

PATROL = """
<Sequence name="Patrol">
  <ZonesRemaining name="ZonesRemaining?"/>
  <NavigateToZone/>
  <DetectSurvivor/>
  <IsSurvivorDetected name="IsSurvivorDetected?"/>
  <AdvanceZone/>
</Sequence>
"""


def simulated_tree(body, parameters=None, registry=None, **assumed):
    return simulated_file(document(body), parameters, registry, **assumed)


def simulated_file(text, parameters=None, registry=None, **assumed):
    binding = bind_main(forest_of(text), registry or default_registry())
    return compile_simulated(binding, parameters or {}, Assumptions(**assumed))


def outcomes_of(simulated, name):
    return [leaf.outcomes for leaf in simulated.leaves if leaf.name == name]


def test_mission_leaves_are_simulated_without_ros_node():
    simulated = simulated_tree(PATROL)
    assert [leaf.tag for leaf in simulated.leaves] == [
        "ZonesRemaining",
        "NavigateToZone",
        "DetectSurvivor",
        "IsSurvivorDetected",
        "AdvanceZone",
    ]
    assert type(simulated.root) is composites.Sequence


def test_built_in_leaves_are_not_simulated():
    simulated = simulated_tree('<Sequence><Script code="a := 1"/><Success/><Sleep msec="500"/></Sequence>')
    assert simulated.leaves == ()
    assert isinstance(simulated.root.children[1], behaviours.Success)
    assert simulated.root.children[2].node_class is SleepNode


def test_random_leaf_is_simulated():
    (leaf,) = simulated_tree("<ProbabilisticBehaviour/>").leaves
    assert [answer.status for answer in leaf.outcomes] == ["SUCCESS", "FAILURE", "RUNNING"]


def test_durations_use_manual_clock():
    simulated = simulated_tree('<Sleep msec="60000"/>')
    simulated.root.tick_once()
    assert simulated.root.status == Status.RUNNING
    simulated.clock.advance(60.0)
    simulated.root.tick_once()
    assert simulated.root.status == Status.SUCCESS


def test_facts_have_initial_values_of_leaves():
    assert simulated_tree(PATROL).fact_values() == {
        "zones_left": 3,
        "at": "",
        "navigation_lost": False,
        "found_by_DetectSurvivor": False,
        "named_by_DetectSurvivor": False,
    }


def test_assumed_facts_replace_initial_values():
    assert simulated_tree(PATROL, facts={"zones_left": 1}).fact_values()["zones_left"] == 1


def test_nominal_run_visits_every_zone():
    simulated = simulated_tree(PATROL)
    for _ in range(3):
        simulated.root.tick_once()
        assert simulated.root.status == Status.SUCCESS
    simulated.root.tick_once()
    assert simulated.root.status == Status.FAILURE
    assert simulated.fact_values()["zones_left"] == 0


def test_outcome_policy_decides_for_every_leaf():
    class Last:
        def choose(self, leaf, options):
            return options[-1]

    simulated = simulated_tree(PATROL)
    simulated.policy = Last()
    assert isinstance(simulated.policy, Last)
    simulated.root.tick_once()
    assert simulated.events[-1].outcome == "not arrived"
    assert simulated_tree("<Success/>").policy is None


def test_searches_of_same_name_have_separate_facts():
    text = """<root BTCPP_format="4" main_tree_to_execute="Main">
    <BehaviorTree ID="Main"><Sequence><SubTree ID="Look" name="first"/><SubTree ID="Look" name="second"/></Sequence>
    </BehaviorTree>
    <BehaviorTree ID="Look"><Sequence><DetectSurvivor/><IsSurvivorDetected/></Sequence></BehaviorTree></root>"""
    simulated = simulated_file(text)
    whens = [options[0].when for options in outcomes_of(simulated, "IsSurvivorDetected")]
    assert whens == ["found_by_DetectSurvivor", "found_by_DetectSurvivor_2"]
    assert {"found_by_DetectSurvivor", "found_by_DetectSurvivor_2"} <= set(simulated.fact_values())
    assert [leaf.path for leaf in simulated.leaves][::2] == [
        ("Sequence", "first", "Sequence", "DetectSurvivor"),
        ("Sequence", "second", "Sequence", "DetectSurvivor"),
    ]


@pytest.mark.parametrize(
    ("key", "rank"),
    [
        ("Main/Patrol/Go", 3),
        ("Patrol/Go", 3),
        ("Main/Go", 3),
        ("Main/NavigateToZone", 3),
        ("Go", 2),
        ("NavigateToZone", 1),
        ("Patrol/Main/Go", 0),
        ("Patrol", 0),
        ("Go/Patrol", 0),
    ],
)
def test_leaf_matches_its_path_name_or_tag(key, rank):
    assert match_rank(key, ("Main", "Patrol", "Go"), "NavigateToZone") == rank


def test_assumption_by_name_takes_precedence_over_tag():
    body = '<Sequence><NavigateToZone/><NavigateToZone name="Back"/></Sequence>'
    one, other = (Outcome("SUCCESS", "one"),), (Outcome("FAILURE", "other"),)
    simulated = simulated_tree(body, outcomes={"Back": other, "NavigateToZone": one})
    # The name of the first node equals its tag.
    assert outcomes_of(simulated, "NavigateToZone") + outcomes_of(simulated, "Back") == [one, other]


PALETTE = """<root BTCPP_format="4"><BehaviorTree ID="Main">{}</BehaviorTree><TreeNodesModel>
<Action ID="Grab"/><Condition ID="Full"/><Control ID="Both"/><Decorator ID="Twice"/>
</TreeNodesModel></root>"""


def test_described_leaf_has_outcomes_of_its_kind():
    grab, full = simulated_file(PALETTE.format("<Sequence><Grab/><Full/></Sequence>")).leaves
    assert [answer.status for answer in grab.outcomes] == ["SUCCESS", "FAILURE", "RUNNING"]
    assert [answer.status for answer in full.outcomes] == ["SUCCESS", "FAILURE"]


def test_described_controls_and_decorators_cannot_be_simulated():
    with pytest.raises(UnknownBehaviourError) as error:
        simulated_file(PALETTE.format("<Both><Twice><Grab/></Twice><Twice><Full/></Twice></Both>"))
    assert [
        (found.code, found.message.split(",")[0], found.span.column) for found in error.value.findings
    ] == [
        (
            "only-described",
            "<Both> is only described by a model. A model does not define when a node ticks its children",
            48,
        ),
        (
            "only-described",
            "<Twice> is only described by a model. A model does not define when a node ticks its children",
            54,
        ),
    ]


def test_replacement_of_described_node_has_its_own_defaults():
    model = (
        '<Control ID="Recover"><input_port name="memory" type="int"/></Control>'
        '<Decorator ID="Rate"><input_port name="hz" type="double"/><output_port name="code"/></Decorator>'
    )
    tree = '<Recover memory="2"><Rate hz="{speed}" code="{code}"><Success/></Rate></Recover>'
    text = f'<root BTCPP_format="4"><BehaviorTree ID="Main">{tree}</BehaviorTree><TreeNodesModel>{model}</TreeNodesModel></root>'
    registry = default_registry()
    binding = bind_main(forest_of(text), registry)
    replace_nodes(binding, {"Recover": registry["Sequence"], "Rate": registry["PassThrough"]})
    simulated = compile_simulated(binding, {})
    assert isinstance(simulated.root, composites.Sequence)
    assert simulated.root.memory
    simulated.root.tick_once()
    assert simulated.root.status == Status.SUCCESS


def test_missing_parameter_is_reported_with_how_to_set_it():
    with pytest.raises(TreeError, match=r"the mission has no parameter 'patience'") as error:
        simulated_tree('<Timeout duration="{@patience}"><NavigateToZone/></Timeout>')
    hint = error.value.findings[0].hint
    assert hint == (
        "set it with --params FILE, or with parameters: {patience: ...} in the scenario or properties file"
    )
    assert simulated_tree(
        '<Timeout duration="{@patience}"><NavigateToZone/></Timeout>', {"patience": 30.0}
    ).leaves


class Wait(Behaviour):
    """A leaf with a parameter."""

    def __init__(self, name: str, sec: float = 1.0) -> None:
        super().__init__(name)

    def update(self) -> Status:
        return Status.SUCCESS


def registry_with(**leaves):
    """Return the registry with further leaves, given as the arguments of `register` by tag."""
    registry = Registry(default_registry().specs())
    for tag, said in leaves.items():
        registry.add(getattr(register(tag, kind=Kind.ACTION, **said)(type(tag, (Wait,), {})), MARK))
    return registry


def test_simulated_leaf_needs_no_parameters():
    (leaf,) = simulated_tree('<Pause sec="{@patience}"/>', registry=registry_with(Pause={})).leaves
    assert isinstance(leaf, StubLeaf)


class Loud(Decorator):
    """A decorator that needs a context object of the mission."""

    def __init__(self, name: str, child: Behaviour, radio: Radio) -> None:
        super().__init__(name, child)
        self.radio = radio

    def update(self) -> Status:
        return self.decorated.status


def test_own_decorator_is_real_and_receives_preview_context():
    registry = Registry(default_registry().specs())
    registry.add(getattr(register("Loud", kind=Kind.DECORATOR)(Loud), MARK))
    simulated = simulated_tree("<Loud><NavigateToZone/></Loud>", registry=registry)
    assert isinstance(simulated.root, Loud)
    assert simulated.root.radio.channel == "preview"
    simulated.root.tick_once()
    assert simulated.root.status == Status.SUCCESS


def test_described_leaf_can_be_assumed_to_skip():
    text = PALETTE.format("<Sequence><Grab/><Success/></Sequence>")
    simulated = simulated_file(text, outcomes={"Grab": (Outcome("SKIPPED"),)})
    simulated.root.tick_once()
    assert simulated.root.status == Status.SUCCESS
    assert simulated.leaves[0].skipped


def test_conflicting_initial_facts_are_disputed_until_set():
    body = "<Sequence><One/><Two/></Sequence>"
    registry = registry_with(One={"facts": {"left": 1}}, Two={"facts": {"left": 2}})
    disputed = simulated_tree(body, registry=registry)
    assert disputed.disputes == {
        "left": "the leaf 'One' declares the initial value 1 of the fact 'left', but 'Two' declares 2. Set the value with facts: {left: 1}"
    }
    settled = simulated_tree(body, registry=registry, facts={"left": 2})
    assert (settled.disputes, settled.fact_values()) == ({}, {"left": 2})


@pytest.mark.parametrize(
    ("written", "possible"),
    [
        ("", "postponed"),
        (' attempts="1"', "tried often enough"),
        (' attempts="{@tries}"', "tried often enough"),
    ],
)
def test_integer_placeholder_has_written_value(written, possible):
    simulated = simulated_tree(f"<PostponeZone{written}/>", {"tries": 1})
    assert [answer.label for answer in simulated.leaves[0].options()] == [possible]


def test_constant_of_subtree_replaces_placeholder():
    inner = '<BehaviorTree ID="Inner"><PostponeZone attempts="{tries}"/></BehaviorTree>'
    outer = '<BehaviorTree ID="Outer"><SubTree ID="Inner" tries="1"/></BehaviorTree>'
    text = f'<root BTCPP_format="4" main_tree_to_execute="Outer">{outer}{inner}</root>'
    assert [answer.label for answer in simulated_file(text).leaves[0].options()] == ["tried often enough"]


def test_missing_parameter_of_placeholder_is_reported():
    with pytest.raises(TreeError, match="attempts: the mission has no parameter 'tries'"):
        simulated_tree('<PostponeZone attempts="{@tries}"/>')


def test_tree_that_can_skip_uses_nodes_that_support_skipping():
    simulated = simulated_tree('<Sequence><NavigateToZone _skipIf="true"/><Success/></Sequence>')
    simulated.root.tick_once()
    assert simulated.root.status == Status.SUCCESS
    assert simulated.events == []


def test_binding_can_be_simulated_repeatedly():
    binding = bind_main(forest("<AdvanceZone/>"), default_registry())
    one, other = compile_simulated(binding, {}), compile_simulated(binding, {})
    one.root.tick_once()
    assert (one.fact_values()["zones_left"], other.fact_values()["zones_left"]) == (2, 3)


class Strict(Decorator):
    """A decorator of a user that does not support skipped children."""

    def __init__(self, name: str, child: Behaviour) -> None:
        super().__init__(name, child)

    def update(self) -> Status:
        return self.decorated.status


def test_described_leaf_skips_below_own_class_only_if_declared():
    registry = Registry(default_registry().specs())
    registry.add(getattr(register("Strict", kind=Kind.DECORATOR)(Strict), MARK))
    text = PALETTE.format("<Strict><Grab/></Strict>")
    assert isinstance(simulated_file(text, registry=registry).root, Strict)
    for key in ("Grab", "Strict/Grab"):
        with pytest.raises(TreeError) as error:
            simulated_file(text, registry=registry, outcomes={key: (Outcome("SUCCESS"), Outcome("SKIPPED"))})
        (finding,) = error.value.findings
        assert finding.code == "skip-misread"
        assert finding.message == "'Grab' can be skipped, which <Strict> treats as an interruption"
