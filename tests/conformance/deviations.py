"""Intended differences from BehaviorTree.CPP, recognised by their symptoms.

Differences that last beyond the tick in which they show are in `as_there`.
"""

import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

from sar_compiler.nodes.btcpp.port_types import is_number, is_untyped, may_share
from sar_compiler.nodes.cpp_names import TEXT, normalize
from sar_compiler.nodes.spec import Kind
from sar_compiler.tree.diagnostic import TreeError
from sar_compiler.tree.model import Element
from sar_compiler.tree.xml import parse_xml


class Refusal(NamedTuple):
    """A finding because of which a tree is rejected here.

    Attributes:
        line: Its line.
        column: Its column.
        code: Its code.
        message: Its message.
    """

    line: int
    column: int
    code: str
    message: str


@dataclass(frozen=True)
class Difference:
    """The first difference in a run.

    Attributes:
        run: The run, as BehaviorTree.CPP recorded it.
        tick: The tick, from 0; -1 if the tree was rejected, or should have been.
        what: What differs: refused, accepted, events, root, or the path and key of an entry.
        expected: The value of BehaviorTree.CPP.
        seen: The value here; for a tree that was accepted, the codes of its findings.
        error: The error that was raised here.
    """

    run: Mapping[str, Any]
    tick: int
    what: str
    expected: str
    seen: str
    error: str = ""

    def __str__(self) -> str:
        """Return the difference as one line."""
        if self.what == "refused":
            return f"refused here: {_line(self.seen)}"
        if self.what == "accepted":
            return f"accepted here, refused there: {_line(self.expected)}"
        raised = f" ({_line(self.error)})" if self.error else ""
        return f"{self.run['mode']}, tick {self.tick}, {self.what}: {self.expected} there, {self.seen} here{raised}"

    @property
    def exception(self) -> str:
        """The exception that BehaviorTree.CPP raised in that tick."""
        ticks = self.run.get("ticks", ())
        return str(ticks[self.tick].get("exception", "")) if 0 <= self.tick < len(ticks) else ""

    @property
    def refusals(self) -> list[Refusal]:
        """The findings that were reported here."""
        found = _FINDING.findall(self.seen) if self.what == "refused" else []
        return [Refusal(int(line), int(column), code, message) for line, column, code, message in found]

    @property
    def exceptions(self) -> Iterator[str]:
        """The exceptions that BehaviorTree.CPP raised in the whole run."""
        return (str(tick.get("exception", "")) for tick in self.run.get("ticks", ()))


Case = Mapping[str, Any]
Rule = Callable[[Case, Difference], bool]
RefusalRule = Callable[[Case, Difference, Refusal], bool]

_FINDING = re.compile(r":(\d+):(\d+): error\[([a-z-]+)\]: (.*)")
_RAISED_IN = re.compile(r"Exception in node '(?:[^']*/)?([^'/]*)' \[(\w+)\]: (?!scripted throw)")
_KIND_TAGS = {kind.value for kind in Kind}
_MISSING = re.compile(r"<\w+> needs the attribute '(\w+)'")
_FRONT = re.compile(r"'-?(?:[0-9]|\.[0-9])[^']*' is not (?:a number|an integer)")
_TYPES = re.compile(r"initially created with type \[([^]]*)\] and, later type \[([^]]*)\]")
_NO_VARIABLE = re.compile(r"there is no variable '(\w+)'")
_DECLARED = re.compile(r"Previously declared type \[([^]]*)\], current type \[([^]]*)\]")
_OF_TYPES = {"btcpp-version", "cpp-type-mismatch"}
# The ports of BehaviorTree.CPP, and of the leaves of the traces, that have no default.
_NO_DEFAULT = {
    *(f"case_{number}" for number in range(1, 7)),
    *("code", "delay_msec", "entry", "id", "if", "key", "msec", "num_attempts", "num_cycles"),
    *("output_key", "queue", "value", "variable"),
}


def deviation(case: Case, difference: Difference) -> str | None:
    """Return why a difference is intended, or None. For a rejection, each finding must be intended."""
    if difference.what != "refused":
        return next((reason for reason, applies in _RULES if applies(case, difference)), None)
    reasons = [
        next((reason for reason, applies in _REFUSALS if applies(case, difference, refusal)), None)
        for refusal in difference.refusals
    ]
    known = [reason for reason in reasons if reason is not None]
    return "; ".join(dict.fromkeys(known)) if known and len(known) == len(reasons) else None


def _refused_before(case: Case, difference: Difference, refusal: Refusal) -> bool:
    """Return whether the node of a finding raised an error there; a script's error names its parent."""
    nodes = _nodes_at(case, refusal)
    if not refusal.message.startswith("_"):
        nodes = nodes[-1:]
    raised = [match.groups() for text in difference.exceptions if (match := _RAISED_IN.match(text))]
    return any(_is_called(node, name, tag) for node in nodes for name, tag in raised)


def _nodes_at(case: Case, refusal: Refusal) -> list[Element]:
    """Return the element of a finding, preceded by its parent."""
    try:
        root = parse_xml(case["xml"]).root
    except TreeError:
        return []
    place = (refusal.line, refusal.column)
    before = [each for each in root.iterate() if (each.line, each.column) <= place]
    if not before:
        return []
    parents = [each for each in before if any(child is before[-1] for child in each.children)]
    return [*parents, before[-1]]


def _is_called(element: Element, name: str, tag: str) -> bool:
    """Return whether BehaviorTree.CPP gives an element this name; a node without a name has a number."""
    own = element.attributes.get("ID", "") if element.tag in _KIND_TAGS else element.tag
    given = element.attributes.get("name", own)
    return own == tag and (name == given if given != own else name.startswith(f"{own}::"))


def _port_missing(_: Case, __: Difference, refusal: Refusal) -> bool:
    match = _MISSING.match(refusal.message)
    return match is not None and match.group(1) in _NO_DEFAULT


def _too_large(_: Case, __: Difference, refusal: Refusal) -> bool:
    return refusal.code == "script-error" and " is too large for a" in refusal.message


def _front_of_literal(_: Case, __: Difference, refusal: Refusal) -> bool:
    return refusal.code == "wrong-value" and _FRONT.search(refusal.message) is not None


def _front_of_entry(_: Case, difference: Difference) -> bool:
    """Return whether a port could not read a string here, and read only its beginning there."""
    return difference.expected != "EXCEPTION" and bool(
        re.search(r"\{\w+\}: " + _FRONT.pattern, difference.error)
    )


def _types_of_a_key(case: Case, difference: Difference) -> bool:
    """Return whether types were rejected that may not share a key here either.

    Here this is a warning, unless the file does not show both types.
    """
    if difference.what != "accepted":
        return False
    match = _TYPES.search(difference.expected) or _DECLARED.search(difference.expected)
    is_refused = match is not None and not may_share(*map(normalize, match.groups()))
    is_given = any(f"[{key}]" in difference.expected for key in case.get("bb", {}))
    return is_refused and (is_given or not _OF_TYPES.isdisjoint(difference.seen.split()))


def _text_by_root_key(_: Case, difference: Difference) -> bool:
    """Return whether a string came first through a key of the main tree that subtrees receive."""
    match = _DECLARED.search(difference.expected) if difference.what == "accepted" else None
    is_text = match is not None and normalize(match.group(1)) == TEXT
    return is_text and "Blackboard entry [@" in difference.expected


def _set_over_another(_: Case, difference: Difference) -> bool:
    """Return whether a number was rejected there because a port of another plain type declared the entry."""
    match = _DECLARED.search(difference.exception)
    if match is None:
        return False
    declared, current = map(normalize, match.groups())
    return (is_number(declared) or declared == TEXT) and (is_number(current) or is_untyped(current))


def _never_reached(case: Case, difference: Difference, refusal: Refusal) -> bool:
    """Return whether an unreachable count is rejected in a node that was never ticked there.

    BehaviorTree.CPP raises such an error before the node ticks a child.
    """
    below = {each.attributes.get("id") for node in _nodes_at(case, refusal)[-1:] for each in node.iterate()}
    ticked = {event[1] for tick in difference.run.get("ticks", ()) for event in tick.get("events", ())}
    return refusal.code == "out-of-reach" and not below & ticked


def _of_two_types(case: Case, _: Difference, refusal: Refusal) -> bool:
    text_given = any(isinstance(value, str) for value in case.get("bb", {}).values())
    return refusal.code == "key-of-two-types" and text_given


def _loop_over_another(_: Case, difference: Difference) -> bool:
    return re.search(r"\[Loop\w+\]: (Any::copyInto fails|.*to integer)", difference.exception) is not None


def _no_delay(case: Case, difference: Difference) -> bool:
    """Return whether a delay of zero expired in its first tick there, or had not expired in a later one."""
    if difference.tick < 0 or "period_ms" not in case:
        return False
    more = difference.expected.count("tick ") > difference.seen.count("tick ")
    sooner = more or difference.seen == "RUNNING" or difference.what.startswith("blackboard")
    before, now = (
        {} if tick < 0 else difference.run["ticks"][tick].get("status", {})
        for tick in (difference.tick - 1, difference.tick)
    )
    delays = (each for each in parse_xml(case["xml"]).root.iterate() if each.tag == "Delay")
    for delay in delays:
        if delay.attributes.get("delay_msec") == "0" and now:
            begins = "RUNNING" not in _statuses(before, delay)
            waits = "RUNNING" in _statuses(now, delay) and "IDLE" in _statuses(now, delay.children[0])
            if begins is not waits and (waits or sooner):
                return True
    return False


def _statuses(status: Mapping[str, str], element: Element) -> list[str]:
    tag = element.attributes.get("ID", "") if element.tag in _KIND_TAGS else element.tag
    return [text for path, text in status.items() if _is_called(element, path.rpartition("/")[2], tag)]


def _sleep_cut_short(case: Case, difference: Difference) -> bool:
    """Return whether a sleep that was halted and restarted between two ticks ended earlier there."""
    halted = any(tick <= difference.tick for tick in case.get("halt_before", ()))
    more = difference.expected.count("tick ") > difference.seen.count("tick ")
    sooner = difference.what == "root" and difference.seen == "RUNNING"
    return "<Sleep" in case["xml"] and halted and (more or sooner)


def _plus_sign(case: Case, difference: Difference) -> bool:
    refused = difference.what == "accepted" or (difference.expected == "EXCEPTION" and not difference.error)
    return refused and re.search(r'="\+[0-9.]', case["xml"]) is not None


def _number_as_key(case: Case, difference: Difference) -> bool:
    return (
        "<SetBlackboard" in case["xml"]
        and re.search(r"output_key: \S+ is no key", difference.error) is not None
    )


def _any_type(_: Case, difference: Difference) -> bool:
    return "BT::Any" in difference.exception and "convertFromString" in difference.exception


def _own_key(case: Case, difference: Difference) -> bool:
    written = re.search(r'<SetBlackboard[^>]* value="(\{=\}|=)"', case["xml"])
    return written is not None and "Can't find the port referred by [value]" in difference.exception


def _script_not_there_yet(case: Case, difference: Difference) -> bool:
    keyed = re.search(r'code=" *\{[^"]*\} *"|code="="', case["xml"])
    return (
        difference.what == "accepted" and "Missing port [code]" in difference.expected and keyed is not None
    )


def _root_key_twice(_: Case, difference: Difference) -> bool:
    return re.search(r": @\w+$", difference.what) is not None and difference.seen == "None"


def _root_key_made(case: Case, difference: Difference) -> bool:
    return '="{@' in case["xml"] and "Bug: report" in difference.exception


def _name_alone(case: Case, difference: Difference) -> bool:
    """Return whether a statement of a script is only the name of an entry that no node has written."""
    match = _NO_VARIABLE.search(difference.error)
    return match is not None and bool(re.search(rf"[\";] *{match.group(1)} *[\";]", case["xml"]))


def _sign_of_no_number(_: Case, difference: Difference) -> bool:
    return "-nan" in difference.expected and difference.expected.replace("-nan", "nan") == difference.seen


def _condition_skipped(case: Case, difference: Difference) -> bool:
    exception = difference.exception
    return ("IfThenElse" in exception or "WhileDoElse" in exception or "IDLE" in exception) and (
        "<IfThenElse" in case["xml"] or "<WhileDoElse" in case["xml"]
    )


def _time_over_skipped_child(case: Case, difference: Difference) -> bool:
    earlier = [
        event for tick in difference.run.get("ticks", ())[: difference.tick] for event in tick["events"]
    ]
    skipped = any("SKIPPED" in event for event in earlier)
    more = difference.seen.count("halt ") > difference.expected.count("halt ")
    return "<Timeout" in case["xml"] and difference.what == "events" and skipped and more


def _explicit_under_reactive(_: Case, difference: Difference) -> bool:
    return difference.what == "accepted" and "Unknown node type" in difference.expected


_REFUSALS: tuple[tuple[str, RefusalRule], ...] = (
    ("a mistake that is met while ticking there is refused before here", _refused_before),
    ("a count out of reach is refused here; there it is only met where the node is ticked", _never_reached),
    ("a node without a port that it needs is refused here; there it fails when it is ticked", _port_missing),
    ("of a text that begins with a number, the rest is dropped there", _front_of_literal),
    ("a number of a script that is too large is 0 there", _too_large),
    ("ports of two types go together there if the key was given a text before", _of_two_types),
)

_RULES: tuple[tuple[str, Rule], ...] = (
    ("of a text that begins with a number, the rest is dropped there", _front_of_entry),
    ("types that may not share a key there are a warning here", _types_of_a_key),
    ("a text that comes first by a key of the main tree goes with no other type there", _text_by_root_key),
    ("an entry that was first named by a port of another type takes no number there", _set_over_another),
    ("a loop cannot replace there what a script has written to its output", _loop_over_another),
    ("a delay of nothing takes there until its thread has had a turn", _no_delay),
    ("a sleep that is halted and started at once can end too early there", _sleep_cut_short),
    ("a plus sign before a number is refused there", _plus_sign),
    ("a number is taken for a key there", _number_as_key),
    ("an entry that SetBlackboard copied, or whose updates are awaited, takes no text there", _any_type),
    ("SetBlackboard does not find the entry of its own port's name there", _own_key),
    ("the script of an entry must be there before the tree is made", _script_not_there_yet),
    ("a key of the main tree that a subtree is given is listed a second time there", _root_key_twice),
    ("a script cannot make an entry there through a key of the main tree", _root_key_made),
    ("the name of an empty entry is no error there where nothing is made of it", _name_alone),
    ("what is not a number has a sign there", _sign_of_no_number),
    ("IfThenElse and WhileDoElse raise there over a condition that is skipped", _condition_skipped),
    (
        "Timeout never comes there if its time runs out over a child that was skipped",
        _time_over_skipped_child,
    ),
    ("explicit nodes under ReactiveSequence are refused there", _explicit_under_reactive),
)


def _line(text: str) -> str:
    return " ".join(text.split())
