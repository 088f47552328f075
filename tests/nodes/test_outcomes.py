"""Tests of the outcomes of leaves: declared at registration, and filled in for each node."""

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


def resolved_spec(cls):
    """Return the spec of a class, resolved as by the first use of its tag."""
    spec = getattr(cls, MARK)
    Registry([spec]).variants(spec.tag)
    return spec


def register_leaf(**said):
    cls = register("Leaf", kind=Kind.ACTION, **{"outcomes": ANY, **said})(type("Leaf", (Leaf,), {}))
    return resolved_spec(cls)


def test_statuses_become_outcomes_with_success_first():
    assert register_leaf(outcomes={Status.RUNNING, Status.SUCCESS}).outcomes == (
        Outcome("SUCCESS"),
        Outcome("RUNNING"),
    )


def test_leaf_without_outcomes_can_return_all_statuses_but_skipped():
    assert [answer.status for answer in register_leaf(outcomes=()).outcomes] == [
        "SUCCESS",
        "FAILURE",
        "RUNNING",
    ]


def test_outcomes_keep_their_order_and_labels():
    answers = [Outcome("FAILURE", "no"), Outcome("SUCCESS", "yes", when="left > 0", then="left -= 1")]
    spec = register_leaf(outcomes=answers, facts={"left": 2}, reads=["speed"], writes=["place"])
    assert list(spec.outcomes) == answers
    assert (dict(spec.facts), spec.reads, spec.writes) == ({"left": 2}, ("speed",), ("place",))


def test_control_has_no_outcomes():
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
def test_invalid_argument_is_rejected_when_class_is_registered(said, message):
    with pytest.raises(RegistrationError, match=message):
        register_leaf(**said)


def test_invalid_script_is_rejected_when_tag_is_first_used():
    with pytest.raises(
        RegistrationError, match=r"<Leaf>: outcome 'yes': when 'left >': a value is missing after '>'"
    ):
        register_leaf(outcomes=[Outcome("SUCCESS", "yes", when="left >")])


@pytest.mark.parametrize(
    "said", [{"outcomes": [Outcome("SUCCESS", when="by_{name}")]}, {"facts": {"by_{name}": 1}}]
)
def test_placeholder_stands_for_node_or_reference(said):
    with pytest.raises(RegistrationError, match=r"unknown placeholder \{name\} \(known: \{self\}, \{say\}"):
        register_leaf(**said)
    assert register_leaf(facts={"by_{self}": 1, "by_{say}": 2}).facts


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


def register_trying_leaf(**said):
    cls = register("Trying", kind=Kind.ACTION, **{"outcomes": ANY, **said})(type("Trying", (Trying,), {}))
    return resolved_spec(cls)


def test_placeholder_in_script_stands_for_integer_attribute():
    answers = [Outcome("SUCCESS", when="tried < {tries}"), Outcome("FAILURE"), Outcome("RUNNING")]
    assert register_trying_leaf(outcomes=answers, facts={"tried": 0}).outcomes == tuple(answers)
    with pytest.raises(RegistrationError, match=r"unknown placeholder \{tries\} \(known: \{self\}"):
        register_trying_leaf(facts={"after_{tries}": 0})
    with pytest.raises(RegistrationError, match=r"outcome 'SUCCESS': then '\{tries\} = 1'"):
        register_trying_leaf(outcomes=[Outcome("SUCCESS", then="{tries} = 1"), *answers[1:]])


def test_negative_number_is_written_in_parentheses():
    assert [number_text(3), number_text(-1)] == ["3", "(-1)"]


def test_placeholders_are_replaced_by_identifiers():
    answer = Outcome("SUCCESS", "found", when="left_{self} > 0", then="by_{say} = true")
    assert fill_outcome(answer, {"self": "Look", "say": "Tell"}) == Outcome(
        "SUCCESS", "found", when="left_Look > 0", then="by_Tell = true"
    )


def test_location_of_script_error_refers_to_text_with_placeholders():
    mistake = find_script_error(Outcome("SUCCESS", then="by_{self} = = 1"), ["self"])
    assert mistake is not None
    part, text, error = mistake
    assert (part, text[error.start : error.end]) == ("then", "=")


def test_nodes_with_equal_identifiers_get_unique_ones():
    identifiers = Identifiers()
    assert [identifiers.make_unique(name) for name in ("Look!", "Look?", "Über 9")] == [
        "Look_",
        "Look__2",
        "_ber_9",
    ]


def test_nominal_outcome_is_first_final_one():
    running, failure, success = Outcome("RUNNING"), Outcome("FAILURE"), Outcome("SUCCESS")
    assert nominal([running, failure, success]) is failure
    assert nominal([running]) is running


@pytest.mark.parametrize(
    "spec", [spec for spec in default_registry() if spec.kind.is_leaf], ids=lambda spec: spec.tag
)
def test_outcomes_of_installed_leaf_have_exactly_its_statuses(spec):
    assert {answer.status for answer in spec.outcomes} == (spec.statuses or {"SUCCESS", "FAILURE", "RUNNING"})


def test_input_port_is_no_placeholder():
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
        resolved_spec(cls(Watching))
