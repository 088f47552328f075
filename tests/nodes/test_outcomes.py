"""What a leaf can answer where there is no robot: said when it is registered, filled in for each node."""

import pytest
from py_trees.behaviour import Behaviour
from py_trees.common import Status

from sar_compiler.leaves import Kind, Outcome, register
from sar_compiler.nodes.outcomes import Identifiers, fill_outcome, find_script_error, number_text
from sar_compiler.nodes.registry import Registry, default_registry
from sar_compiler.nodes.spec import MARK, RegistrationError
from sar_compiler.runtime.outcomes import nominal
from sar_compiler.runtime.ports import Input
from tests.nodes.leaves import Say

ANY = {Status.SUCCESS, Status.FAILURE, Status.RUNNING}


class Leaf(Behaviour):
    """A leaf.

    Args:
        name: The node's name.
        say: The one to listen to.
    """

    def __init__(self, name: str, say: Say) -> None:
        super().__init__(name)

    def update(self) -> Status:
        return Status.SUCCESS


def used(cls):
    """Return what a class means, as somebody learns who uses its tag."""
    spec = getattr(cls, MARK)
    Registry([spec]).variants(spec.tag)
    return spec


def registered(**said):
    cls = register("Leaf", kind=Kind.ACTION, **{"outcomes": ANY, **said})(type("Leaf", (Leaf,), {}))
    return used(cls)


def test_a_leaf_that_says_nothing_more_answers_each_of_its_outcomes_success_first():
    assert registered(outcomes={Status.RUNNING, Status.SUCCESS}).outcomes == (
        Outcome("SUCCESS"),
        Outcome("RUNNING"),
    )


def test_a_leaf_without_outcomes_can_answer_anything_but_skipped():
    assert [answer.status for answer in registered(outcomes=()).outcomes] == ["SUCCESS", "FAILURE", "RUNNING"]


def test_answers_keep_their_order_and_their_words():
    answers = [Outcome("FAILURE", "no"), Outcome("SUCCESS", "yes", when="left > 0", then="left -= 1")]
    spec = registered(outcomes=answers, facts={"left": 2}, reads=["speed"], writes=["place"])
    assert list(spec.outcomes) == answers
    assert (dict(spec.facts), spec.reads, spec.writes) == ({"left": 2}, ("speed",), ("place",))


def test_a_control_has_no_answers():
    assert default_registry()["Sequence"].outcomes == ()


@pytest.mark.parametrize(
    ("said", "message"),
    [
        (
            {"outcomes": ["SUCCESS"]},
            "outcomes contains the string 'SUCCESS'; write Status.SUCCESS, or Outcome",
        ),
        ({"outcomes": Outcome("SUCCESS")}, "write a list or tuple"),
        (
            {"outcomes": [Outcome("SUCESS")]},
            "the status the string 'SUCESS'; write one of SUCCESS, FAILURE, RUNNING, SKIPPED",
        ),
        ({"outcomes": [Outcome("SUCCESS"), Outcome("SUCCESS")]}, "outcomes contains 'SUCCESS' twice"),
        ({"facts": ["left"]}, "facts is .*; write names and initial values"),
        ({"facts": {"zones left": 1}}, "the string 'zones left' is not a valid fact name"),
        ({"facts": {"left": [1]}}, r"the fact 'left' is \[1\]; write a number"),
        ({"reads": "left"}, "reads is the string 'left'; write a list or tuple"),
    ],
)
def test_what_cannot_be_meant_is_refused_when_the_class_is_marked(said, message):
    with pytest.raises(RegistrationError, match=message):
        registered(**said)


def test_a_script_that_cannot_be_read_is_refused_when_the_tag_is_first_used():
    with pytest.raises(
        RegistrationError, match=r"<Leaf>: outcome 'yes': when 'left >': a value is missing after '>'"
    ):
        registered(outcomes=[Outcome("SUCCESS", "yes", when="left >")])


@pytest.mark.parametrize(
    "said", [{"outcomes": [Outcome("SUCCESS", when="by_{name}")]}, {"facts": {"by_{name}": 1}}]
)
def test_a_placeholder_stands_for_the_node_itself_or_for_a_reference(said):
    with pytest.raises(RegistrationError, match=r"unknown placeholder \{name\} \(known: \{self\}, \{say\}"):
        registered(**said)
    assert registered(facts={"by_{self}": 1, "by_{say}": 2}).facts


class Trying(Behaviour):
    """Tries.

    Args:
        name: The node's name.
        tries: How often.
    """

    def __init__(self, name: str, tries: int = 3) -> None:
        super().__init__(name)

    def update(self) -> Status:
        return Status.SUCCESS


def trying(**said):
    cls = register("Trying", kind=Kind.ACTION, **{"outcomes": ANY, **said})(type("Trying", (Trying,), {}))
    return used(cls)


def test_in_scripts_a_placeholder_stands_for_the_value_of_a_whole_number():
    answers = [Outcome("SUCCESS", when="tried < {tries}"), Outcome("FAILURE"), Outcome("RUNNING")]
    assert trying(outcomes=answers, facts={"tried": 0}).outcomes == tuple(answers)
    with pytest.raises(RegistrationError, match=r"unknown placeholder \{tries\} \(known: \{self\}"):
        trying(facts={"after_{tries}": 0})
    with pytest.raises(RegistrationError, match=r"outcome 'SUCCESS': then '\{tries\} = 1'"):
        trying(outcomes=[Outcome("SUCCESS", then="{tries} = 1"), *answers[1:]])


def test_a_number_below_zero_stands_in_parentheses():
    assert [number_text(3), number_text(-1)] == ["3", "(-1)"]


def test_identifiers_take_the_place_of_placeholders():
    answer = Outcome("SUCCESS", "found", when="left_{self} > 0", then="by_{say} = true")
    assert fill_outcome(answer, {"self": "Look", "say": "Tell"}) == Outcome(
        "SUCCESS", "found", when="left_Look > 0", then="by_Tell = true"
    )


def test_the_place_of_a_mistake_is_that_in_the_text_with_its_placeholders():
    mistake = find_script_error(Outcome("SUCCESS", then="by_{self} = = 1"), ["self"])
    assert mistake is not None
    part, text, error = mistake
    assert (part, text[error.start : error.end]) == ("then", "=")


def test_nodes_of_one_name_get_identifiers_of_their_own():
    identifiers = Identifiers()
    assert [identifiers.make_unique(name) for name in ("Look!", "Look?", "Über 9")] == [
        "Look_",
        "Look__2",
        "_ber_9",
    ]


def test_what_is_usual_is_the_first_answer_that_is_an_end():
    running, failure, success = Outcome("RUNNING"), Outcome("FAILURE"), Outcome("SUCCESS")
    assert nominal([running, failure, success]) is failure
    assert nominal([running]) is running


@pytest.mark.parametrize(
    "spec", [spec for spec in default_registry() if spec.kind.is_leaf], ids=lambda spec: spec.tag
)
def test_every_outcome_of_a_registered_leaf_is_among_its_answers(spec):
    assert {answer.status for answer in spec.outcomes} == (spec.statuses or {"SUCCESS", "FAILURE", "RUNNING"})


def test_a_port_that_has_another_value_in_every_tick_stands_for_nothing():
    class Watching(Behaviour):
        """A leaf.

        Args:
            name: The node's name.
            tries: How often.
        """

        def __init__(self, name: str, tries: Input[int]) -> None:
            super().__init__(name)

    cls = register("Watching", kind=Kind.ACTION, outcomes=[Outcome("SUCCESS", when="{tries} > 1")])
    with pytest.raises(RegistrationError, match=r"unknown placeholder \{tries\} \(known: \{self\}"):
        used(cls(Watching))
