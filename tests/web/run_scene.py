"""Imitates a run in a separate process, with its journal and page: `python -m tests.web.run_scene SCENE JOURNAL`.

It prints the address of its page, and continues until it is killed. At each SIGUSR1 it prints the first line of `--view text`.
"""

import signal
import sys
from concurrent.futures import Future
from pathlib import Path

from sar_compiler.journal.journal import Journal
from sar_compiler.journal.journal_entries import GOAL_ENDED, GOAL_SENT, Ending
from sar_compiler.journal.journal_opening import open_journal
from sar_compiler.journal.mission_state import MissionState
from sar_compiler.runtime.clock import ManualClock
from sar_compiler.views.mission_view import screen
from sar_compiler.web.feed import LiveFeed
from sar_compiler.web.page_server import PageServer
from tests.web.conftest import ABOUT, KINDS, Patrol

VERBS = [
    {"name": name, "label": name.title(), "help": "", "confirm": confirm, "role": role, "fields": []}
    for name, role, confirm in (("pause", "hold", ""), ("resume", "release", ""), ("abort", "stop", "Sure?"))
]


PROGRESS = {"target": "east", "distance": 2.5, "time_left": 5.0}


def drive(journal):
    """Drive to the second point, 84 s after the start."""
    journal.clock.advance(42.0)
    journal.record_event("point_reached", point="north")
    journal.clock.advance(42.0)
    journal.record_observation("pose", x=1.0, y=2.0, yaw=0.5)
    journal.record_observation("progress", **PROGRESS)
    journal.record_event(GOAL_SENT, action="navigate_to_pose", goal="a")


def hold(journal):
    drive(journal)
    journal.record_observation(GOAL_ENDED, goal="a", status=5)
    journal.record_event("held", is_held=True)


def lack(text, **more):
    def happen(journal):
        drive(journal)
        journal.record_observation("lacks", text=text, **more)
        journal.record_event("point_added", point="west", x=0.0, y=0.0)

    return happen


def finish(ending, status, reason, *facts):
    def happen(journal):
        drive(journal)
        journal.record_observation("status", node=1, tick=9, status="FAILURE", message="no way there")
        journal.record_observation(GOAL_ENDED, goal="a", status=6)
        for fact in facts:
            journal.record_event(fact)
        if status == 0:  # so that no task is open
            journal.record_event("point_reached", point="east")
        journal.end_run(ending, status, reason)

    return happen


SCENES = {
    "driving": drive,
    "paused": hold,
    "waiting for Nav2": lack("the navigation (Nav2) is not active: bt_navigator is inactive"),
    "no localisation": lack("No transform from 'map' has come for 3 s", is_position_lost=True),
    "complete": finish(Ending.OVER, 0, "Every point was visited."),
    "failed": finish(Ending.OVER, 1, "No point is left. east was not visited."),
    "aborted": finish(Ending.OVER, 1, "The patrol has ended where the robot stands.", "aborted"),
}
"""The functions that bring a run to a scene, by its name."""


def fly(journal: Journal, scene: str) -> None:
    """Start a run, and bring it to a scene."""
    journal.clock = ManualClock(100.0)
    journal.attach(Patrol(), KINDS)
    journal.begin(ABOUT, {"node": "/patrol"})
    SCENES[scene](journal)


class Deaf:
    """Accepts every command without an effect."""

    def send(self, *_):
        answer: Future[tuple[bool, str]] = Future()
        answer.set_result((True, "done"))
        return answer


def main(scene: str, place: str) -> None:
    """Bring a run to a scene, and serve its page."""
    # The signal is blocked before other threads start, so that they inherit the mask.
    signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGUSR1})
    journal = open_journal(Path(place))
    state = MissionState()
    journal.add_listener(state.apply)
    verbs = [[verb["name"] for verb in VERBS]]
    feed = LiveFeed({"robots": ["/patrol"], "verbs": [VERBS]}, lambda: {"verbs": verbs})
    journal.add_listener(feed.add_entry)
    fly(journal, scene)
    server = PageServer(feed, 0, Deaf())
    server.start()
    print(server.url, flush=True)  # noqa: T201 - the parent process reads it
    while True:
        if signal.sigtimedwait({signal.SIGUSR1}, 1.0) is not None:
            title, *_ = screen(state, state.now.time, 3)
            print(*(piece.text for piece in title), flush=True)  # noqa: T201 - as above
        elif scene == "driving":  # a driving robot reports its progress every second
            journal.record_observation("progress", **PROGRESS)


if __name__ == "__main__":
    main(*sys.argv[1:])
