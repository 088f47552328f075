"""Tests of keys that a leaf writes only with some outcomes, and that are read after another outcome."""

import pytest
from py_trees.behaviour import Behaviour
from py_trees.common import Status

from sar_compiler.checks import check
from sar_compiler.leaves import Kind, Outcome
from sar_compiler.nodes.registry import Registry, default_registry
from sar_compiler.nodes.spec import NodeSpec
from sar_compiler.runtime.ports import Input, Output
from tests.trees import document, forest_of

CODE = "maybe-unwritten-key"


class Look(Behaviour):
    def __init__(self, name: str, at: Output[str], left: Output[str] | None = None) -> None:
        super().__init__(name)
        self.at, self.left = at, left

    def update(self) -> Status:
        return Status.SUCCESS


class Say(Behaviour):
    def __init__(self, name: str, text: Input[str]) -> None:
        super().__init__(name)
        self.text = text

    def update(self) -> Status:
        return Status.SUCCESS


STATUSES = frozenset({"SUCCESS", "FAILURE", "RUNNING"})
OUTCOMES = (
    Outcome("SUCCESS", "seen", writes=("at",)),
    Outcome("FAILURE", "gone", writes=("at",)),
    Outcome("FAILURE", "dark", writes=()),
    Outcome("RUNNING", "looking", writes=()),
)
CERTAIN = tuple(answer for answer in OUTCOMES if answer.label != "dark")
REGISTRY = Registry(
    [
        *default_registry().specs(),
        NodeSpec("Look", Look, Kind.ACTION, STATUSES, outcomes=OUTCOMES),
        NodeSpec("LookWell", Look, Kind.ACTION, STATUSES, outcomes=CERTAIN),
        NodeSpec("LookSomehow", Look, Kind.ACTION, STATUSES),
        NodeSpec("Say", Say, Kind.ACTION, frozenset({"SUCCESS"})),
    ]
)
LOOK, SAY = '<Look at="{a}"/>', '<Say text="{a}"/>'


def findings_in(tree: str) -> list[tuple[int, int, str]]:
    findings = check(forest_of(document(tree)), REGISTRY)
    return [(each.span.line, each.span.column, each.message) for each in findings if each.code == CODE]


WRONG = {
    "after its failure": (f"<Fallback>\n{LOOK}\n{SAY}\n</Fallback>", (5, 12)),
    "after its failure in a sequence": (f"<Fallback>\n<Sequence>{LOOK}<AlwaysSuccess/></Sequence>\n{SAY}\n</Fallback>", (5, 12)),
    "after a failure that counts as success": (f"<Sequence>\n<ForceSuccess>{LOOK}</ForceSuccess>\n{SAY}\n</Sequence>", (5, 12)),
    "after a failure that is turned round": (f"<Sequence>\n<Inverter>{LOOK}</Inverter>\n{SAY}\n</Sequence>", (5, 12)),
    "in a branch beside it": (f'<Parallel>\n<LookWell at="{{a}}"/>\n{SAY}\n</Parallel>', (5, 12)),
    "an output that no answer is sure to write": (
        '<Sequence>\n<Look at="{b}" left="{a}"/>\n<Say text="{a}"/>\n<Say text="{b}"/>\n</Sequence>', (5, 12),
    ),
    "after both of two": (f"<Fallback>\n{LOOK}\n{LOOK}\n{SAY}\n</Fallback>", (6, 12)),
    "in a script": (f'<Fallback>\n{LOOK}\n<Script code="b := a"/>\n</Fallback>', (5, 20)),
    "in the first script before a node": (f'<Fallback>\n{LOOK}\n<AlwaysSuccess _skipIf="a == 1"/>\n</Fallback>', (5, 25)),
    "later in the branch": (f"<Fallback>\n{LOOK}\n<Sequence><AlwaysSuccess/>\n{SAY}</Sequence>\n</Fallback>", (6, 12)),
    "in a subtree": (
        f"""<Fallback>\n{LOOK}\n<SubTree ID="Other" a="{{a}}"/>\n</Fallback>
        </BehaviorTree>\n<BehaviorTree ID="Other">\n{SAY}""", (9, 12),
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", WRONG)
def test_read_after_outcome_that_does_not_write_is_reported(name: str) -> None:
    tree, place = WRONG[name]
    findings = findings_in(tree)
    assert [each[:2] for each in findings] == [place]


RIGHT = {
    "after its success": f"<Sequence>{LOOK}{SAY}</Sequence>",
    "after a failure that writes": f'<Fallback><LookWell at="{{a}}"/>{SAY}</Fallback>',
    "of a leaf that does not say it": f'<Fallback><LookSomehow at="{{a}}"/>{SAY}</Fallback>',
    "with a value from before": f"<Sequence><Script code=\"a := ''\"/><Fallback>{LOOK}{SAY}</Fallback></Sequence>",
    "with a value from a leaf that does not say it": (
        f'<Sequence><LookSomehow at="{{a}}"/><Fallback>{LOOK}{SAY}</Fallback></Sequence>'
    ),
    "where the first of two has succeeded": f"<Sequence>{LOOK}<Fallback>{LOOK}{SAY}</Fallback></Sequence>",
    "behind a condition": f'<Fallback>{LOOK}<Sequence><ScriptCondition code="seen == 1"/>{SAY}</Sequence></Fallback>',
    "with a script before the branch": f'<Fallback>{LOOK}<Sequence _skipIf="seen == 0">{SAY}</Sequence></Fallback>',
    "after a condition between the two": f'<Fallback>{LOOK}<ScriptCondition code="seen == 0"/>{SAY}</Fallback>',
    "after one that may be skipped": f'<Fallback><Sequence _skipIf="seen == 0">{LOOK}</Sequence>{SAY}</Fallback>',
    "where it is chosen": f'<IfThenElse><ScriptCondition code="seen == 1"/><Sequence>{LOOK}{SAY}</Sequence>{SAY}</IfThenElse>',
}


@pytest.mark.parametrize("name", RIGHT)
def test_read_that_may_be_correct_has_no_findings(name: str) -> None:
    assert findings_in(f'<Sequence><Script code="seen := 0"/>{RIGHT[name]}</Sequence>') == []


def test_message_names_leaf_outcome_and_remedy() -> None:
    (finding,) = (
        each
        for each in check(forest_of(document(f"<Fallback>{LOOK}{SAY}</Fallback>")), REGISTRY)
        if each.code == CODE
    )
    assert (
        finding.message
        == "text: 'a' may not be written yet: 'Look' (line 3) does not write it when it ends with 'dark'"
    )
    assert finding.hint == 'assign it in an earlier node: <Script code="a := ..."/>'
