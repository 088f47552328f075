"""The states of a tree as PRISM's explicit files, read by their format alone."""

import re
from collections import deque

from sar_compiler.analysis.verification_view import PrismModel
from sar_compiler.analysis.verify import verify
from sar_compiler.analysis.verify.properties import parse_property_file
from sar_compiler.analysis.verify.verdicts import AN_END
from sar_compiler.tree.diagnostic import TreeError
from tests.analysis.verify.random_trees import random_tree
from tests.analysis.verify.stage import TAGS, bound, simulated_tree, verdict


class Files:
    """What another tool reads in the three files.

    Attributes:
        rows: The variables of each state, as texts.
        ticks: The states that the choices of each state lead to.
        actions: What leaves answer in each of these choices.
        labels: The states with each label.
    """

    def __init__(self, states, transitions, labels):
        head, *lines = "".join(states).splitlines()
        names = head.strip("()").split(",")
        self.rows = [
            dict(zip(names, line.split(":")[1].strip("()").split(","), strict=True)) for line in lines
        ]
        assert [line.split(":")[0] for line in lines] == [str(number) for number in range(len(lines))]
        head, *lines = "".join(transitions).splitlines()
        self.ticks: list[list[int]] = [[] for _ in self.rows]
        self.actions: list[list[str]] = [[] for _ in self.rows]
        for line in lines:
            words = line.split()
            action = words.pop()
            source, choice, target, probability = map(int, words)
            assert (choice, probability) == (len(self.ticks[source]), 1)
            self.ticks[source].append(target)
            self.actions[source].append(action)
        assert head == f"{len(self.rows)} {len(lines)} {len(lines)}"
        head, *lines = "".join(labels).splitlines()
        known = dict(re.findall(r'(\d+)="(\w+)"', head))
        self.labels: dict[str, set[int]] = {name: set() for name in known.values()}
        for state, numbers in (line.split(":") for line in lines):
            for number in numbers.split():
                self.labels[known[number]].add(int(state))

    def distances(self):
        """Return the least number of ticks to each state that can be reached."""
        found = dict.fromkeys(self.labels["init"], 0)
        queue = deque(found)
        while queue:
            state = queue.popleft()
            for target in self.ticks[state]:
                if target not in found:
                    found[target] = found[state] + 1
                    queue.append(target)
        return found

    def can_end(self):
        """Return the states from which an end can be reached."""
        found: set[int] = set()
        following = set(self.labels["end"])
        while following - found:
            found |= following
            following = {state for state, targets in enumerate(self.ticks) if found.intersection(targets)}
        return found


def exported(body, properties=None, max_states=20_000):
    file = None if properties is None else parse_property_file(properties, "props.yaml")
    verification = verify(simulated_tree(bound(body), file), file, TAGS, max_states, keep_states=True)
    assert verification.space is not None
    model = PrismModel(verification.space)
    return verification, Files(model.states(), model.transitions(), model.labels())


RETRIED = '<Sequence><RetryUntilSuccessful num_attempts="{}"><A/></RetryUntilSuccessful><B/></Sequence>'


def test_the_files_have_the_states_and_ticks_that_were_found():
    verification, files = exported(RETRIED.format(3))
    assert len(files.rows) == verification.states
    graph = verification.space.graph
    assert files.ticks == [
        [target for target, _ in graph.ticks(state)] for state in range(verification.states)
    ]
    distances = files.distances()
    assert len(distances) == verification.states
    assert max(distances.values()) == verification.depth
    assert files.can_end() == set(distances)


def test_each_choice_is_called_by_what_leaves_answer_in_it():
    verification, files = exported(RETRIED.format(2))
    assert set(files.actions[0]) == {
        "A_FAILURE",
        "A_RUNNING",
        "A_SUCCESS_B_FAILURE",
        "A_SUCCESS_B_RUNNING",
        "A_SUCCESS_B_SUCCESS",
    }
    assert verification.space is not None
    for state, actions in enumerate(files.actions):
        played = [each.events for each in verification.space.transitions(state)]
        told = ["_".join(f"{e.leaf}_{e.deed}" for e in events if e.what == "answered") for events in played]
        assert [text or "tick" for text in told] == actions or not played


def test_what_no_end_can_be_reached_from_follows_from_the_files():
    answers = "answers: {A: [FAILURE, RUNNING, {status: SUCCESS, when: n == 0}], B: [{status: SUCCESS, then: n = 1}]}"
    verification, files = exported(RETRIED.format(-1), f"facts: {{n: 0}}\n{answers}\nproperties: {{}}")
    distances = files.distances()
    lost = set(distances) - files.can_end()
    trace = verdict(verification, AN_END).trace
    assert trace is not None
    # The run is told as far as the last end that there is; behind it is none.
    assert min(distances[state] for state in lost) == len(trace.ticks) + 1


def test_of_random_trees_the_files_say_the_same_about_ends_as_the_verification():
    seen = set()
    for seed in range(60):
        try:
            verification, files = exported(random_tree(seed), max_states=2_000)
        except TreeError:
            continue
        if not verification.complete or files.labels["error"]:
            continue
        distances = files.distances()
        assert (len(distances), max(distances.values())) == (verification.states, verification.depth), seed
        lost = set(distances) - files.can_end()
        found = verdict(verification, AN_END)
        assert (found.trace is not None) == bool(lost), seed
        if found.trace is not None:
            assert min(distances[state] for state in lost) == len(found.trace.ticks), seed
        seen.add(bool(lost))
    assert seen == {True, False}


def test_numbers_and_truth_values_stand_for_themselves_and_other_values_are_numbered():
    says = "answers: {A: [{status: SUCCESS, then: n += 1; b = n == 2; t = 'far', when: n < 2}, {status: FAILURE}]}"
    verification, files = exported("<A/>", f"facts: {{n: 0, b: false, t: near}}\n{says}\nproperties: {{}}")
    seen = {(row["n"], row["b"], row["t"]) for row in files.rows}
    assert seen == {("0", "false", "0"), ("1", "false", "1"), ("2", "true", "1")}
    assert verification.space is not None
    codes = {variable.name: variable.codes for variable in PrismModel(verification.space).variables}
    assert codes == {"n": {}, "b": {}, "t": {"'near'": 0, "'far'": 1}}


def test_a_key_that_is_not_always_there_is_numbered_and_names_are_those_that_prism_can_read():
    script = '<Sequence><A/><Script code="max := 2.5; state := 7"/></Sequence>'
    verification, files = exported(script)
    assert verification.space is not None
    variables = PrismModel(verification.space).variables
    assert {variable.source: variable.name for variable in variables} == {"max": "max_2", "state": "state_2"}
    assert variables[0].codes == {"nothing": 0, "2.5": 1}
    assert [row["state"] for row in files.rows] == [str(number) for number in range(verification.states)]
    assert {row["state_2"] for row in files.rows} == {"0", "1"}


def test_a_property_has_a_label_for_where_it_is_broken_first_and_one_for_where_something_is_owed():
    properties = (
        "properties: {'B, never!': {never: B starts}, 'b never': {after: A starts, eventually: B SUCCESS}}"
    )
    _, files = exported("<Sequence><A/><B/></Sequence>", properties)
    own = {name for name in files.labels if name.startswith(("breaks", "owes"))}
    assert own == {"breaks_B_never", "breaks_b_never", "owes_b_never"}
    assert files.labels["breaks_B_never"] == {0}
    assert files.labels["owes_b_never"]
    assert 0 not in files.labels["owes_b_never"]


def test_a_state_that_was_not_gone_through_stays_where_it_is():
    verification, files = exported('<Sequence><A/><B/><A name="A2"/></Sequence>', max_states=4)
    beyond = files.labels["unexplored"]
    assert not verification.complete
    assert beyond == files.labels["deadlock"] != set()
    assert all(files.ticks[state] == [state] for state in beyond)


def test_a_tick_that_raises_an_error_is_marked_where_it_begins_and_leads_nowhere():
    _, files = exported('<Sequence><A/><Script code="x := y"/></Sequence>')
    (state,) = files.labels["error"]
    assert state == 0
    assert files.labels["unexplored"] == set()
