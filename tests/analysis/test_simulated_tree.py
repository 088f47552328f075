"""A tree as it flies, but with leaves that answer what is chosen."""

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


def test_leaves_of_a_mission_answer_and_their_node_ros_is_not_asked_for():
    simulated = simulated_tree(PATROL)
    assert [leaf.tag for leaf in simulated.leaves] == [
        "ZonesRemaining",
        "NavigateToZone",
        "DetectSurvivor",
        "IsSurvivorDetected",
        "AdvanceZone",
    ]
    assert type(simulated.root) is composites.Sequence


def test_leaves_of_the_language_are_the_real_ones():
    simulated = simulated_tree('<Sequence><Script code="a := 1"/><Success/><Sleep msec="500"/></Sequence>')
    assert simulated.leaves == ()
    assert isinstance(simulated.root.children[1], behaviours.Success)
    assert simulated.root.children[2].node_class is SleepNode


def test_a_leaf_that_answers_by_chance_answers_what_is_chosen():
    (leaf,) = simulated_tree("<ProbabilisticBehaviour/>").leaves
    assert [answer.status for answer in leaf.outcomes] == ["SUCCESS", "FAILURE", "RUNNING"]


def test_durations_are_measured_with_a_clock_that_is_moved_by_hand():
    simulated = simulated_tree('<Sleep msec="60000"/>')
    simulated.root.tick_once()
    assert simulated.root.status == Status.RUNNING
    simulated.clock.advance(60.0)
    simulated.root.tick_once()
    assert simulated.root.status == Status.SUCCESS


def test_facts_begin_as_the_leaves_say():
    assert simulated_tree(PATROL).fact_values() == {
        "zones_left": 3,
        "at": "",
        "navigation_lost": False,
        "found_by_DetectSurvivor": False,
        "named_by_DetectSurvivor": False,
    }


def test_facts_that_are_assumed_take_their_place():
    assert simulated_tree(PATROL, facts={"zones_left": 1}).fact_values()["zones_left"] == 1


def test_a_day_without_surprises_goes_through_every_zone():
    simulated = simulated_tree(PATROL)
    for _ in range(3):
        simulated.root.tick_once()
        assert simulated.root.status == Status.SUCCESS
    simulated.root.tick_once()
    assert simulated.root.status == Status.FAILURE
    assert simulated.fact_values()["zones_left"] == 0


def test_an_outcome_policy_decides_for_every_leaf():
    class Last:
        def choose(self, leaf, options):
            return options[-1]

    simulated = simulated_tree(PATROL)
    simulated.policy = Last()
    assert isinstance(simulated.policy, Last)
    simulated.root.tick_once()
    assert simulated.events[-1].outcome == "not arrived"
    assert simulated_tree("<Success/>").policy is None


def test_two_searches_of_one_name_have_facts_of_their_own():
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
def test_a_leaf_is_named_by_a_path_by_its_name_or_by_its_tag(key, rank):
    assert match_rank(key, ("Main", "Patrol", "Go"), "NavigateToZone") == rank


def test_what_is_assumed_of_a_name_counts_before_what_is_assumed_of_a_tag():
    body = '<Sequence><NavigateToZone/><NavigateToZone name="Back"/></Sequence>'
    one, other = (Outcome("SUCCESS", "one"),), (Outcome("FAILURE", "other"),)
    simulated = simulated_tree(body, outcomes={"Back": other, "NavigateToZone": one})
    # The first node is called as its tag is.
    assert outcomes_of(simulated, "NavigateToZone") + outcomes_of(simulated, "Back") == [one, other]


PALETTE = """<root BTCPP_format="4"><BehaviorTree ID="Main">{}</BehaviorTree><TreeNodesModel>
<Action ID="Grab"/><Condition ID="Full"/><Control ID="Both"/><Decorator ID="Twice"/>
</TreeNodesModel></root>"""


def test_a_leaf_that_is_only_described_answers_what_its_kind_can():
    grab, full = simulated_file(PALETTE.format("<Sequence><Grab/><Full/></Sequence>")).leaves
    assert [answer.status for answer in grab.outcomes] == ["SUCCESS", "FAILURE", "RUNNING"]
    assert [answer.status for answer in full.outcomes] == ["SUCCESS", "FAILURE"]


def test_controls_and_decorators_that_are_only_described_are_nothing_to_play():
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


def test_what_stands_for_a_described_node_has_its_defaults_and_none_of_the_ports_that_are_written():
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


def test_a_parameter_that_is_missing_says_where_a_value_is_given():
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
    """A leaf that wants a value."""

    def __init__(self, name: str, sec: float = 1.0) -> None:
        super().__init__(name)

    def update(self) -> Status:
        return Status.SUCCESS


def registry_with(**leaves):
    """Return the registry with further leaves: what `register` is told of each, by their tags."""
    registry = Registry(default_registry().specs())
    for tag, said in leaves.items():
        registry.add(getattr(register(tag, kind=Kind.ACTION, **said)(type(tag, (Wait,), {})), MARK))
    return registry


def test_a_leaf_that_answers_needs_no_parameters():
    (leaf,) = simulated_tree('<Pause sec="{@patience}"/>', registry=registry_with(Pause={})).leaves
    assert isinstance(leaf, StubLeaf)


class Loud(Decorator):
    """A decorator that wants something of the mission."""

    def __init__(self, name: str, child: Behaviour, radio: Radio) -> None:
        super().__init__(name, child)
        self.radio = radio

    def update(self) -> Status:
        return self.decorated.status


def test_a_decorator_of_ones_own_is_made_for_real_with_a_stand_in_for_what_the_mission_has():
    registry = Registry(default_registry().specs())
    registry.add(getattr(register("Loud", kind=Kind.DECORATOR)(Loud), MARK))
    simulated = simulated_tree("<Loud><NavigateToZone/></Loud>", registry=registry)
    assert isinstance(simulated.root, Loud)
    assert simulated.root.radio.channel == "preview"
    simulated.root.tick_once()
    assert simulated.root.status == Status.SUCCESS


def test_a_described_leaf_may_be_assumed_to_skip():
    text = PALETTE.format("<Sequence><Grab/><Success/></Sequence>")
    simulated = simulated_file(text, outcomes={"Grab": (Outcome("SKIPPED"),)})
    simulated.root.tick_once()
    assert simulated.root.status == Status.SUCCESS
    assert simulated.leaves[0].skipped


def test_leaves_that_start_a_fact_differently_are_a_dispute_until_somebody_settles_it():
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
def test_a_placeholder_for_a_whole_number_has_the_value_that_is_written(written, possible):
    simulated = simulated_tree(f"<PostponeZone{written}/>", {"tries": 1})
    assert [answer.label for answer in simulated.leaves[0].options()] == [possible]


def test_a_number_that_is_a_constant_of_the_subtree_takes_the_place_of_its_placeholder():
    inner = '<BehaviorTree ID="Inner"><PostponeZone attempts="{tries}"/></BehaviorTree>'
    outer = '<BehaviorTree ID="Outer"><SubTree ID="Inner" tries="1"/></BehaviorTree>'
    text = f'<root BTCPP_format="4" main_tree_to_execute="Outer">{outer}{inner}</root>'
    assert [answer.label for answer in simulated_file(text).leaves[0].options()] == ["tried often enough"]


def test_a_parameter_for_a_placeholder_that_nobody_gives_is_a_finding():
    with pytest.raises(TreeError, match="attempts: the mission has no parameter 'tries'"):
        simulated_tree('<PostponeZone attempts="{@tries}"/>')


def test_a_tree_that_can_skip_is_made_of_nodes_that_know_it():
    simulated = simulated_tree('<Sequence><NavigateToZone _skipIf="true"/><Success/></Sequence>')
    simulated.root.tick_once()
    assert simulated.root.status == Status.SUCCESS
    assert simulated.events == []


def test_a_forest_may_be_simulated_as_often_as_wanted():
    binding = bind_main(forest("<AdvanceZone/>"), default_registry())
    one, other = compile_simulated(binding, {}), compile_simulated(binding, {})
    one.root.tick_once()
    assert (one.fact_values()["zones_left"], other.fact_values()["zones_left"]) == (2, 3)


class Strict(Decorator):
    """A decorator of a user's, which knows nothing of skipped children."""

    def __init__(self, name: str, child: Behaviour) -> None:
        super().__init__(name, child)

    def update(self) -> Status:
        return self.decorated.status


def test_a_described_leaf_skips_below_a_class_of_ones_own_only_where_somebody_says_so():
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
