"""Tests of the classes of nodes: py_trees' class if no child can be skipped, else the class of this package."""

import py_trees
import pytest
from py_trees import composites, decorators

from sar_compiler.checks import check
from sar_compiler.compiler import bind_main, preview_tree
from sar_compiler.nodes.registry import default_registry
from sar_compiler.runtime import stock
from sar_compiler.runtime.kernel.turning import SubTreeNode, TurningNode
from sar_compiler.runtime.ticking import OwnDecorator, behaviour_class
from tests.trees import forest, forest_of

REGISTRY = default_registry()
TURNING = behaviour_class(OwnDecorator, TurningNode)
SUBTREE = behaviour_class(OwnDecorator, SubTreeNode)
SKIPPED = '<Success _skipIf="true"/>'

PAIRS = [
    ("Sequence", composites.Sequence, stock.Sequence),
    ("ReactiveSequence", composites.Sequence, stock.Sequence),
    ("Fallback", composites.Selector, stock.Fallback),
    ("Selector", composites.Selector, stock.Fallback),
    ("ReactiveFallback", composites.Selector, stock.Fallback),
    ("Inverter", decorators.Inverter, TURNING),
    ("ForceSuccess", decorators.FailureIsSuccess, TURNING),
    ("ForceFailure", decorators.SuccessIsFailure, TURNING),
    ("KeepRunningUntilFailure", decorators.SuccessIsRunning, TURNING),
]


def root(body):
    return preview_tree(bind_main(forest(body), REGISTRY)).root


def all_of(body):
    return {type(node) for node in root(body).iterate()}


@pytest.mark.parametrize(("tag", "plain", "skipping"), PAIRS)
def test_py_trees_class_is_used_if_no_child_can_be_skipped(tag, plain, skipping):
    assert type(root(f"<{tag}><Success/></{tag}>")) is plain


@pytest.mark.parametrize(("tag", "plain", "skipping"), PAIRS)
def test_own_class_is_used_if_child_can_be_skipped(tag, plain, skipping):
    assert type(root(f"<{tag}>{SKIPPED}</{tag}>")) is skipping


@pytest.mark.parametrize(
    "child",
    [
        SKIPPED,
        '<Success _while="true"/>',
        "<RunOnce><Success/></RunOnce>",
        '<Precondition if="true" else="SKIPPED"><Success/></Precondition>',
        '<SkipUnlessUpdated entry="{a}"><Success/></SkipUnlessUpdated>',
        f"<Sequence><Inverter>{SKIPPED}</Inverter></Sequence>",
        f'<Parallel success_count="1" failure_count="1">{SKIPPED}</Parallel>',
    ],
)
def test_skippable_descendant_is_detected_through_intermediate_nodes(child):
    assert type(root(f"<Fallback><Failure/>{child}</Fallback>")) is stock.Fallback


@pytest.mark.parametrize(
    ("opening", "closing", "skips"),
    [
        ('<RunOnce then_skip="false">', "</RunOnce>", False),
        ('<RunOnce then_skip="{a}">', "</RunOnce>", True),
        ('<Precondition if="true">', "</Precondition>", False),
        ('<Precondition if="true" else="SUCCESS">', "</Precondition>", False),
        ('<Precondition if="true" else="{a}">', "</Precondition>", True),
        ('<LoopInt queue="1;2">', "</LoopInt>", False),
        ('<LoopInt queue="1;2" if_empty="SKIPPED">', "</LoopInt>", True),
    ],
)
def test_skippability_depends_on_value_of_attribute(opening, closing, skips):
    around = "<Fallback><Failure/>{}</Fallback>"
    wanted = stock.Fallback if skips else composites.Selector
    assert type(root(around.format(f"{opening}<Success/>{closing}"))) is wanted
    assert type(root(around.format(f"{opening}{SKIPPED}{closing}"))) is stock.Fallback


def test_conditions_that_cannot_skip_do_not_change_class_of_parent():
    assert (
        type(root('<Sequence><Success _failureIf="true" _onSuccess="a := 1"/></Sequence>'))
        is composites.Sequence
    )


def test_node_that_is_never_skipped_hides_skippable_child():
    body = f"<Sequence><KeepRunningUntilFailure>{SKIPPED}</KeepRunningUntilFailure></Sequence>"
    assert type(root(body)) is composites.Sequence


def with_subtree(inner):
    trees = (
        '<root main_tree_to_execute="Main"><BehaviorTree ID="Main"><Sequence><SubTree ID="B"/></Sequence></BehaviorTree>'
        f'<BehaviorTree ID="B">{inner}</BehaviorTree></root>'
    )
    return preview_tree(bind_main(forest_of(trees), REGISTRY)).root


def test_subtree_is_py_trees_decorator_unless_it_can_be_skipped():
    plain, skipping = with_subtree("<Success/>"), with_subtree(SKIPPED)
    assert [type(plain), type(plain.children[0])] == [composites.Sequence, py_trees.decorators.PassThrough]
    assert [type(skipping), type(skipping.children[0])] == [stock.Sequence, SUBTREE]


def test_oneshot_around_skippable_node_is_reported():
    (finding,) = check(
        forest('<Sequence _skipIf="a == 1" oneshot="ON_COMPLETION"><Success/></Sequence>'), REGISTRY
    )
    assert (finding.code, finding.span.line, finding.span.column) == ("skip-misread", 3, 28)
    assert "RunOnce" in (finding.hint or "")
