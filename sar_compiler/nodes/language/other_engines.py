"""Nodes of other behaviour tree engines, and their replacements in sar_compiler."""

from typing import NamedTuple


class Replacement(NamedTuple):
    """The replacement for a node of another engine.

    Attributes:
        engine: The name of the engine.
        hint: The instruction for the user.
    """

    engine: str
    hint: str


def _replacements(engine: str, **hints: str) -> dict[str, Replacement]:
    return {tag: Replacement(engine, hint) for tag, hint in hints.items()}


_ROS = "with --model ros:jazzy, write "
_TOPIC = f'{_ROS}<RosTopic topic="..." type="..." fields="FIELD: {{KEY}}" waits="true"/>'
_ACTION = f'{_ROS}<RosAction action="..." type="..." goal="..."/>'
_PUBLISH = f'{_ROS}<RosPublish topic="..." type="..." message="data: {{KEY}}"/>'
_CHECK = 'write <ScriptCondition code="KEY == VALUE"/>'
_REPEAT = 'write <Repeat num_cycles="-1"> around the child'
_UNTIL_SUCCESS = 'write <RetryUntilSuccessful num_attempts="-1"> around the child'
_UNTIL_FAILURE = "write <KeepRunningUntilFailure> around the child"
_MEMORY_FALLBACK = "write <Fallback>, which continues with the child that was running"
_REACTIVE = "write <ReactiveFallback>"
_SLEEP = 'write <Sleep msec="..."/>, in milliseconds'
_NO_CHANCE = "no control has a random order: write <Fallback>, or let a leaf choose the child"

REPLACEMENTS = {
    **_replacements(
        "py_trees_ros",
        ToBlackboard=_TOPIC,
        EventToBlackboard=_TOPIC,
        WaitForData=_TOPIC,
        CheckData=_TOPIC.replace(' waits="true"', ""),
        FromAction=_ACTION,
        FromConstant=_ACTION,
        ActionClient=_ACTION,
        ServiceClient=f'{_ROS}<RosService service="..." type="..." request="..."/>',
        FromBlackboard=_PUBLISH,
        TransformToBlackboard=f'{_ROS}<RosTransform target_frame="..." source_frame="..." x="{{KEY}}"/>',
    ),
    **_replacements(
        "BehaviorTree.CPP 3", ManualSelector="write <Fallback>: no node asks the operator to choose a child"
    ),
    **_replacements(
        "other engines",
        MemSequence="write <Sequence>, which continues with the child that was running",
        MemSelector=_MEMORY_FALLBACK,
        MemPriority=_MEMORY_FALLBACK,
        SelectorStar=_MEMORY_FALLBACK,
        Priority=_REACTIVE,
        PrioritySelector=_REACTIVE,
        RandomSelector=_NO_CHANCE,
        RandomSequence=_NO_CHANCE.replace("Fallback", "Sequence"),
        SimpleParallel='write <Parallel success_count="1" failure_count="1">',
        ParallelSequence='write <Parallel success_count="-1" failure_count="1">',
        ParallelSelector='write <Parallel success_count="1" failure_count="-1">',
        Repeater=_REPEAT,
        RepeatForever=_REPEAT,
        UntilSuccess=_UNTIL_SUCCESS,
        RepeatUntilSuccess=_UNTIL_SUCCESS,
        UntilFail=_UNTIL_FAILURE,
        UntilFailure=_UNTIL_FAILURE,
        RepeatUntilFailure=_UNTIL_FAILURE,
        Negate="write <Inverter> around the child",
        Succeeder="write <ForceSuccess> around the child",
        AlwaysSucceed="write <ForceSuccess> around the child",
        Failer="write <ForceFailure> around the child",
        AlwaysFail="write <ForceFailure> around the child",
        MaxTime='write <Timeout msec="..."> around the child, in milliseconds',
        TimeLimit='write <Timeout msec="..."> around the child, in milliseconds',
        WaitAction=_SLEEP,
        SetVariable='write <Script code="KEY := VALUE"/>',
        CheckVariable=_CHECK,
        BlackboardCondition=_CHECK,
        Expression='write <ScriptCondition code="..."/>',
        RunSubTree='write <SubTree ID="..."/>',
        Concurrence='write <Parallel success_count="-1" failure_count="1">',
    ),
}
"""The replacements for nodes of other engines, by tag.

The names that nodes had in BehaviorTree.CPP 3 are in `former_tags` of a spec.
"""
