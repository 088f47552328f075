"""Tests with the trees of BehaviorTree.CPP's own tests: a tree has an error if and only if BehaviorTree.CPP rejects the tree."""

import re
from xml.sax.saxutils import escape

import pytest

from sar_compiler.checks import check
from sar_compiler.nodes.registry import default_registry
from sar_compiler.tree.diagnostic import Severity
from tests.trees import document, forest_of

# Trees as TAG[ATTRIBUTES](CHILDREN). Tags that are no nodes of the language are leaves of its tests.
ACCEPTED = """
Delay[delay_msec=100](AlwaysSuccess)
Fallback(Inverter(IsDoorClosed) RetryUntilSuccessful[num_attempts=5](PickLock) SmashDoor)
ForceFailure(AlwaysSuccess)
ForceSuccess(AlwaysFailure)
IfThenElse(AlwaysFailure TestA AlwaysFailure)
IfThenElse(AlwaysFailure TestA)
IfThenElse(AlwaysSuccess AlwaysFailure TestA)
IfThenElse(AlwaysSuccess TestA TestB)
Inverter(AlwaysFailure)
KeepRunningUntilFailure[_skipIf=check](AlwaysSuccess)
KeepRunningUntilFailure(SuccessThenFail)
LoopBool[queue=true;false;true value={val}](CountTicks)
LoopDouble[queue=1.5;2.5;3.5 value={val}](CountTicks)
LoopInt[queue=1;2;3 value={val}](CountTicks)
LoopInt[queue= if_empty=SKIPPED value={val}](CountTicks)
LoopInt[queue={my_queue} value={val}](CountTicks)
LoopString[queue=hello;world;test value={val}](CountTicks)
Parallel[failure_count=1 success_count=-1](TestA Sleep[msec=100])
Parallel[success_count=1 failure_count=3](GoodTest BadTest SlowTest)
Parallel[success_count=2 failure_count=1](Sequence(TestA Sleep[msec=200]) Sequence(TestA Sleep[msec=200]))
ParallelAll[max_failures=1](BadTest GoodTest GoodTest)
ParallelAll[max_failures=2](BadTest GoodTest GoodTest)
Precondition[if=true else=FAILURE](KeepRunning)
ReactiveFallback(AlwaysFailure AlwaysFailure AlwaysFailure)
ReactiveFallback(AlwaysSuccess TestA)
ReactiveFallback(IsWarm ReactiveSequence(IsHoldingJacket WearJacket))
ReactiveSequence(AlwaysFailure AlwaysFailure Sleep[msec=100])
ReactiveSequence(Sequence(TestA TestB TestC) AsyncSequence(TestD TestE TestF))
ReactiveSequence(TestA AlwaysSuccess Sleep[msec=100])
ReactiveSequence(TestA TestB TestC)
Repeat[num_cycles=2](TestA)
Sequence(AlwaysSuccess AlwaysFailure)
Sequence(Fallback(WasEntryUpdated[entry=A] TestA) SkipUnlessUpdated[entry=A](TestB))
Sequence(RunOnce(TestA) TestB)
Sequence(TestA[_skipIf=1] TestB[_while=0])
SequenceWithMemory(TestA TestB TestC)
SetBlackboard[value=42 output_key=value]
TryCatch(AlwaysFailure AlwaysFailure)
TryCatch(AlwaysFailure RunningThenFailure)
TryCatch(AlwaysFailure TestA TestB)
TryCatch(FailThenSucceed TestA)
TryCatch(RunningThenSuccess TestA)
TryCatch(TestA AlwaysFailure TestB)
TryCatch(TestA TestB AlwaysFailure TestC)
TryCatch(TestA TestB TestC)
TryCatch(TestA TestB)
TryCatch[catch_on_halt=true](AlwaysFailure RunningCatch)
WhileDoElse(AlwaysFailure TestA AlwaysFailure)
WhileDoElse(AlwaysFailure TestA)
WhileDoElse(AlwaysSuccess AlwaysFailure TestA)
WhileDoElse(RunningThenSuccess TestA TestB)
"""
# BehaviorTree.CPP rejects these when it reads them, or raises at their first tick.
REJECTED = """

AlwaysSuccess AlwaysFailure
ForceFailure
Inverter(AlwaysSuccess AlwaysFailure)
IfThenElse(AlwaysSuccess TestA TestB TestC)
IfThenElse(AlwaysSuccess)
Precondition[else=FAILURE](AlwaysSuccess)
ReactiveSequence(AsyncSequence(TestA TestB TestC) AsyncSequence(TestD TestE TestF))
Sequence
Sequence(AlwaysSuccess SubTree[ID=Main])
SetBlackboard[value=42]
SubTree
SubTree[ID=Nowhere]
TryCatch(AlwaysSuccess)
WhileDoElse(AlwaysSuccess TestA TestB TestC)
WhileDoElse(AlwaysSuccess)
"""
_PART = re.compile(r"(\w+)(?:\[([^]]*)\])?(\()?|(\))")


def lines(table):
    return table[1:].splitlines()


def as_xml(notation):
    """Return a tree of the table as XML."""
    written: list[str] = []
    around: list[str] = []
    for tag, attributes, is_opened, is_closed in _PART.findall(notation):
        pairs = [each.partition("=") for each in attributes.split()]
        values = "".join(f' {name}="{escape(value)}"' for name, _, value in pairs)
        if is_closed:
            written.append(f"</{around.pop()}>")
        else:
            written.append(f"<{tag}{values}{'>' if is_opened else '/>'}")
            around += [tag] if is_opened else []
    return "".join(written)


def custom_leaves(notation):
    """Return the leaves of a tree that only exist in the tests of BehaviorTree.CPP."""
    known = {spec.tag for spec in default_registry()} | {"SubTree"}
    tags = {tag for tag, *_ in _PART.findall(re.sub(r"\[[^]]*\]", "", notation)) if tag}
    return sorted(tags - known)


def errors(notation):
    """Return the codes of the errors in a tree with a model of its custom leaves."""
    model = "".join(f'<Action ID="{tag}"/>' for tag in custom_leaves(notation))
    text = document(as_xml(notation)).replace("</root>", f"<TreeNodesModel>{model}</TreeNodesModel></root>")
    found = check(forest_of(text), default_registry())
    return [each.code for each in found if each.severity is Severity.ERROR]


def errors_without_model(notation):
    """Return the codes of the errors in a tree without a model of its custom leaves."""
    found = check(forest_of(document(as_xml(notation))), default_registry())
    return {each.code for each in found if each.severity is Severity.ERROR}


@pytest.mark.parametrize("notation", lines(ACCEPTED))
def test_tree_accepted_by_btcpp_has_no_error(notation):
    assert errors(notation) == []


@pytest.mark.parametrize("notation", lines(REJECTED))
def test_tree_rejected_by_btcpp_has_error(notation):
    assert errors(notation)
    assert "internal-error" not in errors(notation)


@pytest.mark.parametrize("notation", lines(ACCEPTED))
def test_accepted_tree_without_model_has_only_unknown_leaves(notation):
    assert errors_without_model(notation) == ({"unknown-node"} if custom_leaves(notation) else set())
