"""Leaves that are available in every mission's trees."""

from functools import partial

from sar_compiler.nodes import outcome_sets
from sar_compiler.nodes.btcpp import rewrites
from sar_compiler.nodes.declaring import CLOCK, ENUMS, SCOPE, attribute, inout_port, input_port, node_spec
from sar_compiler.nodes.language.narrow_types import (
    ANY_ENTRY,
    CHECKS,
    KEY,
    NTH,
    PROBABILITIES,
    STATUS_NAMES,
    VARIABLE,
    Comparison,
    Junction,
    StatusName,
)
from sar_compiler.nodes.language.node_rules import language_spec, report_empty_queue, stock
from sar_compiler.nodes.semantics import REMOVES, WRITES, AccessKind, Counterpart, KeyRole, Semantics
from sar_compiler.nodes.spec import Kind, NodeSpec, Parameter
from sar_compiler.nodes.values import AS_WRITTEN, CONDITION, MILLISECONDS, SECONDS
from sar_compiler.runtime.expressions import Script

_SUCCESS, _FAILURE, _RUNNING = (frozenset({word}) for word in ("SUCCESS", "FAILURE", "RUNNING"))
_PEEKS = KeyRole(AccessKind.PEEK)
_WRITTEN = KeyRole(AccessKind.WRITE)
_REMOVED = KeyRole(AccessKind.NONE)

_own = partial(language_spec, Kind.ACTION)
_stock = partial(stock, Kind.ACTION)


def _peeking_semantics(*ports: str, resumes: bool = False) -> Semantics:
    """Return the semantics of a leaf that accepts keys without a value in the attributes *ports*."""
    return Semantics(keys=dict.fromkeys(ports, _PEEKS), resumes=resumes)


def _as_in_btcpp(tag: str) -> Semantics:
    """Return the semantics of a leaf that exists in BehaviorTree.CPP under another name."""
    return Semantics(counterpart=Counterpart(rewrite=partial(rewrites.rename, tag)))


def _question(
    tag: str, doc: str, *parameters: Parameter, asks: tuple[str, ...], made_by: str = ""
) -> NodeSpec:
    """Return the spec of a py_trees condition that accepts keys that no node has written."""
    return stock(
        Kind.CONDITION,
        tag,
        doc,
        *parameters,
        SCOPE,
        statuses=_SUCCESS | _FAILURE,
        semantics=_peeking_semantics(*asks),
        made_by=made_by,
    )


_KEY = input_port("variable_name", VARIABLE, "The key, or `key.attribute`.")
_COMPARE = "The comparison: equal, not equal, less, less or equal, greater, greater or equal."
_CONSTANT = "a number, `true`, `false`, any other string, a list or an object after `json:`, or the value of another `{key}` at the time of the tick."
_COMPARISON = (
    input_port("variable", VARIABLE, "The key, or `key.attribute`."),
    attribute(
        "operator",
        Comparison,
        f"{_COMPARE} A string is never equal to a number, and a string and a number cannot be ordered.",
    ),
    input_port("value", object, f"The value to compare with: {_CONSTANT}"),
)

BEHAVIORTREE_CPP = [
    _own("AlwaysSuccess", "py_trees.behaviours:Success", "Succeeds.", statuses=_SUCCESS),
    _own("AlwaysFailure", "py_trees.behaviours:Failure", "Fails.", statuses=_FAILURE),
    _own(
        "Script",
        "language_nodes:RunScript",
        "Runs a script, and succeeds.",
        input_port("code", Script, "The script."),
        SCOPE,
        ENUMS,
        statuses=_SUCCESS,
        effects=WRITES,
    ),
    language_spec(
        Kind.CONDITION,
        "ScriptCondition",
        "language_nodes:ScriptCondition",
        "Runs a script, and succeeds if the value of the script is true.",
        # In BehaviorTree.CPP, this port has no type, so the number `1` can be passed to it through a subtree.
        input_port(
            "code",
            CONDITION._replace(cpp=""),
            "The script. The value of the script must be true or false, 1 or 0.",
        ),
        SCOPE,
        ENUMS,
        statuses=_SUCCESS | _FAILURE,
        semantics=Semantics(partial(outcome_sets.condition_of_leaf, "code")),
    ),
    _own(
        "SetBlackboard",
        "language_nodes:SetBlackboard",
        "Copies the value and type of another entry, or writes a string. Fails if the other entry is empty.",
        input_port("value", AS_WRITTEN, "The value to write."),
        input_port(
            "output_key",
            AS_WRITTEN,
            "The key to write, without braces, or a key in braces that contains the name of the key to write.",
        ),
        SCOPE,
        ENUMS,
        statuses=_SUCCESS | _FAILURE,
        effects=WRITES,
        semantics=Semantics(
            keys={"output_key": KeyRole(AccessKind.WRITE, by_name=True, indirect=True)}, copies="value"
        ),
    ),
    _own(
        "UnsetBlackboard",
        "language_nodes:UnsetBlackboard",
        "Removes an entry of the same tree instance. Entries of other instances are not removed.",
        input_port("key", str, "The entry's key, without braces."),
        SCOPE,
        statuses=_SUCCESS,
        effects=REMOVES,
        semantics=Semantics(keys={"key": _REMOVED}),
    ),
    _own(
        "WasEntryUpdated",
        "kernel.leaf_nodes:UpdateCheckNode",
        "Succeeds if an entry was written since the last check; otherwise fails.",
        input_port("entry", ANY_ENTRY, "The entry to check."),
        SCOPE,
        statuses=_SUCCESS | _FAILURE,
        semantics=Semantics(keys={"entry": KeyRole(AccessKind.PEEK, by_name=True)}),
    ),
    _own(
        "Sleep",
        "kernel.timing:SleepNode",
        "Waits, then succeeds.",
        input_port("msec", MILLISECONDS, "Duration of the wait, in milliseconds; 0 to succeed at once."),
        CLOCK,
        statuses=_SUCCESS | _RUNNING,
        semantics=Semantics(wait_sec=partial(outcome_sets.milliseconds, name="msec")),
    ),
]

PY_TREES = [
    _stock("Success", "Succeeds.", statuses=_SUCCESS, semantics=_as_in_btcpp("AlwaysSuccess")),
    _stock("Failure", "Fails.", statuses=_FAILURE, semantics=_as_in_btcpp("AlwaysFailure")),
    _stock(
        "Running",
        "Always returns RUNNING.",
        statuses=_RUNNING,
        semantics=Semantics(counterpart=Counterpart(rewrite=rewrites.rewrite_running)),
    ),
    _stock(
        "Dummy",
        "Returns RUNNING forever, as a placeholder for a node that is not implemented yet.",
        statuses=_RUNNING,
    ),
    _stock(
        "Periodic",
        "Runs for n ticks, succeeds for n ticks, fails for n ticks, and starts over. When the node is started again, it "
        "continues at the same position.",
        attribute(
            "n",
            int,
            "Number of ticks with the same status. With 0 or less, the status changes in every tick.",
        ),
        semantics=Semantics(resumes=True),
    ),
    _stock(
        "StatusQueue",
        "Returns the statuses of a list one after the other. When the node is started again, it continues at the same position.",
        attribute("queue", STATUS_NAMES, "The statuses: `RUNNING;RUNNING;SUCCESS`."),
        attribute(
            "eventually",
            StatusName,
            "The status to return after the end of the list; by default the list starts over.",
            None,
        ),
        rule=report_empty_queue,
        semantics=Semantics(outcome_sets.queue_results, resumes=True),
        made_by="status_queue",
    ),
    _stock(
        "SuccessEveryN",
        "Succeeds in every n-th tick, and fails in all other ticks.",
        attribute(
            "n",
            NTH,
            "The period of the successes in ticks: 1 for every tick, 2 for every second tick. The sign is ignored.",
        ),
        statuses=_SUCCESS | _FAILURE,
    ),
    _stock(
        "TickCounter",
        "Runs for a number of ticks, then completes. The count resets each time the node starts.",
        attribute("duration", int, "The number of ticks to run; 0 or less to complete at once."),
        attribute("completion_status", StatusName, "The status to return after the given number of ticks."),
        semantics=Semantics(outcome_sets.ticks_counted),
    ),
    _stock(
        "ProbabilisticBehaviour",
        "Returns a random status.",
        attribute(
            "weights",
            PROBABILITIES,
            "The weights of success, failure and running, such as `2;1;1`. The weights are equal by default.",
            None,
        ),
        semantics=Semantics(resumes=True),
    ),
    node_spec(
        Kind.ACTION,
        "Timer",
        "sar_compiler.runtime.stock:Timer",
        "Runs for a time measured by the mission's clock, then succeeds.",
        CLOCK,
        attribute("duration", SECONDS, "Duration, in seconds; 0 or less to succeed at once.", 5.0),
        statuses=_SUCCESS | _RUNNING,
        semantics=Semantics(
            wait_sec=partial(outcome_sets.number, name="duration"),
            counterpart=Counterpart(rewrite=rewrites.timer),
        ),
    ),
    _stock(
        "BlackboardToStatus",
        "Returns the status that a key contains, for example from StatusToBlackboard.",
        input_port(
            "variable_name",
            VARIABLE,
            "The key, or `key.attribute`. If it does not contain a status, a tick stops the run with an error.",
        ),
        SCOPE,
        semantics=Semantics(resumes=True),
    ),
    _question(
        "CheckBlackboardVariableExists",
        "Succeeds if a key was written; otherwise fails.",
        _KEY,
        asks=("variable_name",),
    ),
    _stock(
        "WaitForBlackboardVariable",
        "Runs until a key was written, then succeeds.",
        _KEY,
        SCOPE,
        statuses=_SUCCESS | _RUNNING,
        semantics=_peeking_semantics("variable_name", resumes=True),
    ),
    _stock(
        "SetBlackboardVariable",
        "Writes a value to a key.",
        inout_port("variable_name", VARIABLE, "The key, or `key.attribute` of an existing object."),
        input_port("variable_value", object, f"The value: {_CONSTANT}"),
        SCOPE,
        attribute(
            "overwrite",
            bool,
            "If true, the node replaces an existing value. If false, it fails if the key already has a value.",
            default=True,
        ),
        statuses=_SUCCESS | _FAILURE,
        effects=WRITES,
        semantics=Semantics(keys={"variable_name": _WRITTEN}),
    ),
    _stock(
        "UnsetBlackboardVariable",
        "Removes a key from the blackboard, even if another tree owns it, and succeeds.",
        inout_port("key", KEY, "The key."),
        SCOPE,
        statuses=_SUCCESS,
        effects=REMOVES,
        semantics=Semantics(keys={"key": _REMOVED}),
    ),
    _question(
        "CheckBlackboardVariableValue",
        "Succeeds if the comparison of a key with a value is true. Fails if it is false or the key was not written.",
        *_COMPARISON,
        made_by="create_comparison",
        asks=("variable",),
    ),
    _stock(
        "WaitForBlackboardVariableValue",
        "Runs until the comparison of a key with a value is true, then succeeds.",
        *_COMPARISON,
        SCOPE,
        statuses=_SUCCESS | _RUNNING,
        semantics=_peeking_semantics("variable", resumes=True),
        made_by="create_comparison",
    ),
    _question(
        "CheckBlackboardVariableValues",
        "Compares several keys with values, and succeeds if the combined result is true.",
        attribute(
            "checks",
            CHECKS,
            "The comparisons, each a key, an operator and a value: `battery gt 20;speed lt 1.5`. If one of the keys has "
            "no value, the node fails.",
        ),
        attribute(
            "operator",
            Junction,
            "The operator that combines the results of the comparisons, from left to right.",
        ),
        inout_port(
            "namespace",
            KEY,
            "The prefix of the keys to which the results are written. With `results`, the keys are `results/1`, `results/2` and so on.",
            None,
        ),
        made_by="check_values",
        asks=("checks",),
    ),
    _question(
        "CompareBlackboardVariables",
        "Succeeds if the comparison of two keys is true. Fails if it is false or a key was not written. Needs py_trees 2.4.",
        input_port("var1_key", KEY, "The key on the left."),
        input_port("var2_key", KEY, "The key on the right."),
        attribute("operator", Comparison, _COMPARE),
        asks=("var1_key", "var2_key"),
    ),
]

SPECS = [*BEHAVIORTREE_CPP, *PY_TREES]
