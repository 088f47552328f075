"""Determines the open tasks that a mission leaves to people, most urgent first.

The page, the terminal and reports all use this module, so they always show the same tasks. A green status
means that there are no open tasks.
"""

import re
from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

from sar_compiler.journal.display import Landmark, Level
from sar_compiler.journal.journal_entries import Ending
from sar_compiler.journal.mission_state import MissionState
from sar_compiler.journal.status_line import (
    CRASHED,
    ERROR,
    GOOD,
    LOST,
    PAUSED,
    POSITION_LOST,
    QUIET,
    WAITING,
    WARNING,
    condition,
    missing_names,
)

_SEVERITY = (QUIET, GOOD, WARNING, ERROR)
_ALARM_IS_ERROR = 40
# The status line adds that the robot may still be driving.
_STOP_BUTTON = "Press the emergency stop on the robot: STOP on the page may not reach it"
# The words for the state of locations that the mission has not finished.
_UNFINISHED_WORDS: Mapping[int, str] = {Level.TO_COME: "not reached", Level.IN_HAND: "not finished"}
# A reason with one of these verbs is a clause, such as "the battery is low". Other reasons are phrases, such as "skipped by Ann".
_VERB = re.compile(r"\b(is|are|was|were|has|have|had|does|do|did)\b")
# The maximum number of names in a list; further names are only counted.
_MAX_NAMES = 5


class OpenTask(NamedTuple):
    """A task for a person.

    Attributes:
        level: The severity: `warning` or `error`.
        text: The task, as a sentence without a full stop.
        kind: The kind of the landmark to which the task refers; empty if there is none.
        name: The name of the landmark to which the task refers; empty if there is none.
        command: The name or the role of the operator's command that completes the task; empty if there is none.
        is_alarm: Whether the task is an alarm of the mission; the text is then the alarm's message.
    """

    level: str
    text: str
    kind: str = ""
    name: str = ""
    command: str = ""
    is_alarm: bool = False


def find_open_tasks(state: MissionState, *, with_visits: bool = True) -> tuple[OpenTask, ...]:
    """Return the open tasks of a mission. Errors come before warnings, and urgent tasks before others.

    Args:
        state: The state of the mission.
        with_visits: Whether to include, after the end of a run, the visit to detections that no person has confirmed.
    """
    if state.awaited:
        names = missing_names(state)
        them = "it" if sum(bool(each.problem) for each in state.awaited) == 1 else "them"
        text = f"Wait for {names}, or ask an engineer to start {them} on the robot"
        return (OpenTask(WARNING, text),) if names else ()
    if not state.runs:
        return ()
    landmarks = state.situation.landmarks.values()
    found = [
        *_robot_tasks(state),
        *(OpenTask(ERROR, each.task, *_landmark_key(each)) for each in landmarks if each.task),
        *_alarm_tasks(state),
        *_gauge_tasks(state),
        *_detection_tasks(state),
        *(_visit_tasks(state) if with_visits else ()),
        *_location_tasks(state),
        *_figure_tasks(state),
    ]
    return tuple(sorted(found, key=lambda task: -_SEVERITY.index(task.level)))


def severity(state: MissionState) -> str:
    """Return the severity of a mission: the highest severity of its status line and open tasks."""
    return max(
        (condition(state).level, *(task.level for task in find_open_tasks(state))), key=_SEVERITY.index
    )


def _robot_tasks(state: MissionState) -> Iterator[OpenTask]:
    """Yield the tasks about the robot, and about the process that controls the robot."""
    now, run = condition(state), state.runs[-1]
    if "imported" in run.about:
        return  # an imported recording does not allow commands to its robot
    if now.word == LOST or (now.word == CRASHED and state.goals) or (run.ending and state.goals):
        yield OpenTask(ERROR, _STOP_BUTTON)
    elif now.word == CRASHED:
        yield OpenTask(
            ERROR, "Ask an engineer to resume the mission, or fetch the robot: its program has crashed"
        )
    elif run.ending in (Ending.STOPPED, Ending.FAILED):
        how = "was stopped" if run.ending == Ending.STOPPED else "has failed"
        yield OpenTask(
            WARNING, f"Ask an engineer to resume the mission, or fetch the robot: its program {how}"
        )
    elif run.ending and run.status and (end := _missed_end(state)):
        yield OpenTask(WARNING, f"Fetch the robot: it has not reached {end.name}", *_landmark_key(end))
    elif now.word == PAUSED:
        yield OpenTask(WARNING, "Resume the mission, or call the robot back", command="release")
    elif now.word == POSITION_LOST:
        yield OpenTask(
            ERROR,
            "Press the robot's emergency stop if it moves, then ask an engineer to correct its position",
        )
    elif now.word == WAITING:
        # The details after the colon name nodes, and are for engineers.
        cause = now.reason.partition(": ")[0]
        if not cause or cause.startswith("for "):
            cause = f"the robot waits {cause}".rstrip()
        yield OpenTask(WARNING, f"Ask an engineer for help: {cause}")


def _is_over(state: MissionState) -> bool:
    """Return whether the last run has ended or the process of this run has crashed."""
    return bool(state.runs[-1].ending) or state.process.is_gone


def _missed_end(state: MissionState) -> Landmark | None:
    """Return the location where the robot should be at the end but is not, or None if there is none."""
    ends = [each for each in state.situation.landmarks.values() if state.situation.kind_of(each).is_end]
    return ends[0] if ends and all(each.level != Level.DONE for each in ends) else None


def _alarm_tasks(state: MissionState) -> Iterator[OpenTask]:
    for alarm in state.situation.alarms.values():
        if not alarm.is_over:
            level = ERROR if alarm.level >= _ALARM_IS_ERROR else WARNING
            yield OpenTask(level, alarm.text, is_alarm=True)


def _gauge_tasks(state: MissionState) -> Iterator[OpenTask]:
    if _is_over(state):
        return
    target = "" if state.drive is None else state.drive.target
    landmarks = state.situation.landmarks.values()
    is_coming = any(each.name == target and state.situation.kind_of(each).is_end for each in landmarks)
    has_arrived = any(each.level == Level.DONE for each in landmarks if state.situation.kind_of(each).is_end)
    do = "Charge the robot" if has_arrived else "Call the robot back"
    do = f"Expect the robot at {target}" if is_coming else do
    for gauge in state.gauges:
        if gauge.least is not None and gauge.value < gauge.least:
            limit = f"{gauge.least:g} {gauge.unit}".strip()
            yield OpenTask(WARNING, f"{do}: {gauge.text}, below the limit of {limit}")


def _detection_tasks(state: MissionState) -> Iterator[OpenTask]:
    """Yield the tasks about unreviewed detections and unfinished reports."""
    is_over = _is_over(state)
    for each in state.situation.detections():
        kind = state.situation.kind_of(each)
        if each.level == Level.GIVEN_UP:
            continue
        if kind.review and not each.is_certain and not is_over:
            yield OpenTask(
                WARNING, f"Review {each.name}: is it a {kind.name}?", *_landmark_key(each), kind.review
            )
        if is_over and each.level != Level.DONE and not each.task:
            text = f"Report {each.name} yourself: the mission did not finish reporting it"
            yield OpenTask(ERROR, text, *_landmark_key(each))


def _visit_tasks(state: MissionState) -> Iterator[OpenTask]:
    """After a run, yield the task about reported detections that no person has confirmed."""
    unconfirmed = [
        each
        for each in state.situation.detections()
        if each.level == Level.DONE and not each.is_certain and not each.task
    ]
    if unconfirmed and _is_over(state):
        it = "it" if len(unconfirmed) == 1 else "them"
        yield _landmarks_task("Go to", unconfirmed, f"no person has confirmed {it}")


def _location_tasks(state: MissionState) -> Iterator[OpenTask]:
    """Yield the tasks about abandoned locations. After a run, also yield tasks about unfinished locations."""
    is_over, groups = _is_over(state), dict[tuple[str, str], list[Landmark]]()
    for each in state.situation.landmarks.values():
        kind = state.situation.kind_of(each)
        is_unfinished = each.level == Level.GIVEN_UP or (is_over and each.level != Level.DONE and each.state)
        # An outline only repeats the state of its location, unless its kind has a task for a person.
        is_task = kind.remedy or not (each.corners or kind.is_found or kind.is_end)
        if is_unfinished and is_task:
            word = f"{_UNFINISHED_WORDS.get(each.level, each.state) or 'not done'}{_cause(each.reason)}"
            groups.setdefault((kind.name, word), []).append(each)
    for (_, word), places in groups.items():
        yield _landmarks_task(state.situation.kind_of(places[0]).remedy or "Check", places, word)


def _landmarks_task(do: str, landmarks: Sequence[Landmark], word: str) -> OpenTask:
    """Return the warning that asks a person to do the same with each of the landmarks."""
    names = [each.name for each in landmarks[:_MAX_NAMES]]
    more = f" and {len(landmarks) - _MAX_NAMES} more" if len(landmarks) > _MAX_NAMES else ""
    key = _landmark_key(landmarks[0]) if len(landmarks) == 1 else ()
    return OpenTask(WARNING, f"{do} {', '.join(names)}{more}: {word}", *key)


def _cause(reason: str) -> str:
    """Return the part of a task's sentence that states the reason. Omit a reason that only counts attempts."""
    if not reason or reason.startswith("after attempt "):
        return ""
    return f" because {reason}" if _VERB.search(reason) else f", {reason}"


def _figure_tasks(state: MissionState) -> Iterator[OpenTask]:
    """After a mission, yield the tasks about figures that are below the required value."""
    if not _is_over(state):
        return
    for figure in state.situation.figures.values():
        if figure.least is not None and figure.value < figure.least:
            required = f"{figure.least:g} {figure.unit}".strip()
            yield OpenTask(
                WARNING, f"Decide whether to search again: {figure.text}, below the required {required}"
            )


def _landmark_key(landmark: Landmark) -> tuple[str, str]:
    return landmark.kind, landmark.name
