"""Tests that a failing run extension does not end a run of `sar-run`."""

from collections.abc import Callable
from contextlib import ExitStack
from types import SimpleNamespace
from typing import Any, cast

import pytest
from py_trees.behaviours import Running
from py_trees.common import Status

from sar_compiler.cli.run_extensions import requested_extensions
from sar_compiler.errors import SarError
from sar_compiler.execution.extensions import RunExtensions
from sar_compiler.execution.run_setup import RunSetup
from sar_compiler.journal.journal import Journal
from sar_compiler.missions.mission import MissionRun
from sar_compiler.ros.run_extension import RunExtension
from sar_compiler.terminal import RunOutput


class FakeRun:
    """A run, the calls of its extensions, and its log messages."""

    def __init__(self) -> None:
        self.done: list[str] = []
        self.said: list[str] = []
        logger = SimpleNamespace(error=self.said.append)
        self.node: Any = SimpleNamespace(
            get_logger=lambda: logger,
            create_timer=lambda *_, **__: None,
            get_clock=lambda: SimpleNamespace(
                now=lambda: SimpleNamespace(nanoseconds=0), ros_time_is_active=False
            ),
        )
        self.journal, self.output = Journal(), RunOutput()
        no: Any = None
        self.run = RunSetup(
            no, no, self.node, self.journal, MissionRun(), no, no, {}, (), self.output, no, []
        )

    def extend(self, stack: ExitStack, *makes: Callable[[RunSetup], RunExtension]) -> RunExtensions:
        """Create the run's extensions, and one for the journal."""
        journal: Any = Noting(self, "journal", fails=False)
        return RunExtensions(self.run, journal, makes, stack)

    def make(self, name: str, *, fails: bool = False) -> "Noting":
        """Return an extension that records its calls under its name, and may fail."""
        return Noting(self, name, fails=fails)


class Noting(RunExtension):
    """Records each call, and may then fail."""

    def __init__(self, fake_run: FakeRun, name: str, *, fails: bool) -> None:
        self._run, self._name, self._fails = fake_run, name, fails

    def _do(self, what: str) -> None:
        self._run.done.append(f"{self._name} {what}")
        if self._fails:
            raise ValueError(what)

    def on_entry(self, entry: Any) -> None:
        self._do(entry.kind)

    def on_begin(self) -> None:
        self._run.done.append(f"{self._name} began")

    def on_end(self, *, has_begun: bool) -> None:
        self._do("ended" if has_begun else "given up")


@pytest.fixture
def fake_run() -> FakeRun:
    return FakeRun()


def test_extension_that_fails_at_end_does_not_prevent_end_of_others(fake_run: FakeRun) -> None:
    with ExitStack() as stack:
        makes = [lambda _, name=name: fake_run.make(name, fails=name != "b") for name in "abc"]
        fake_run.extend(stack, *makes).on_begin()
    began = ["journal began", "a began", "b began", "c began"]
    assert fake_run.done == [*began, "c ended", "b ended", "a ended", "journal ended"]
    assert fake_run.said == ["Noting could not be closed: ValueError('ended')."] * 2


def test_extension_that_fails_at_event_does_not_affect_others(fake_run: FakeRun) -> None:
    with ExitStack() as stack:
        makes = [lambda _, name=name: fake_run.make(name, fails=name == "a") for name in "ab"]
        fake_run.extend(stack, *makes)
        assert fake_run.journal.is_wanted
        fake_run.journal.record_event("zone_visited")
        fake_run.journal.record_event("base_reached")
    done = [did for did in fake_run.done if not did.startswith("journal")]
    assert done[:3] == ["a zone_visited", "b zone_visited", "b base_reached"]


def test_extensions_are_closed_if_later_one_cannot_be_created(fake_run: FakeRun) -> None:
    def refuse(_: RunSetup) -> RunExtension:
        message = "no"
        raise SarError(message)

    with pytest.raises(SarError), ExitStack() as stack:
        fake_run.extend(stack, lambda _: fake_run.make("a"), refuse)
    assert fake_run.done == ["a given up", "journal given up"]


def test_extension_that_ignores_events_does_not_make_journal_wanted(fake_run: FakeRun) -> None:
    class Silent(RunExtension):
        pass

    with ExitStack() as stack:
        RunExtensions(fake_run.run, cast("Any", Silent()), [lambda _: Silent(), lambda _: None], stack)
        assert not fake_run.journal.is_wanted


@pytest.fixture
def screen(fake_run: FakeRun, monkeypatch: pytest.MonkeyPatch) -> Any:
    """Return a screen that fails to draw, of a run that has started."""
    from sar_compiler.execution.run_view import RunScreen

    def fail(*_: object) -> Any:
        fake_run.done.append("drawn")
        raise ValueError

    monkeypatch.setattr(RunScreen, "_draw", fail)
    made = RunScreen(fake_run.run, lambda *_: [])
    fake_run.journal.add_listener(made.on_entry)
    fake_run.journal.begin({"tree": []}, {})
    return made


@pytest.mark.ros
def test_same_status_in_consecutive_ticks_is_logged_once(
    fake_run: FakeRun, monkeypatch: pytest.MonkeyPatch
) -> None:
    from sar_compiler.execution.run_view import ChangeLog

    lines: list[str] = []
    monkeypatch.setattr(fake_run.output, "print_momentary", lines.append, raising=False)
    fake_run.journal.add_listener(ChangeLog(fake_run.run).on_entry)
    tree = {"class": "x", "name": "Try", "attributes": {}, "children": [], "file": "m.xml", "line": 1}
    fake_run.journal.begin({"tree": tree}, {})
    for tick, status in ((1, "SUCCESS"), (2, "SUCCESS"), (3, "FAILURE"), (4, "SUCCESS"), (6, "SUCCESS")):
        for each in (status, "IDLE"):
            fake_run.journal.record_observation("status", node=0, tick=tick, status=each, message="")
    assert [line.split()[-1] for line in lines] == ["SUCCESS", "FAILURE", "SUCCESS", "SUCCESS"]


@pytest.mark.ros
def test_failed_view_is_reported_and_not_drawn_again(fake_run: FakeRun, screen: Any) -> None:
    screen.refresh()
    screen.refresh()
    fake_run.output.leave()
    assert fake_run.done == ["drawn"]
    assert fake_run.said == ["The view has failed and was switched off: ValueError()."]


@pytest.mark.ros
def test_view_that_cannot_be_closed_is_reported(fake_run: FakeRun, screen: Any) -> None:
    fake_run.output.leave()
    assert fake_run.said == ["The view has failed and was switched off: ValueError()."]


@pytest.mark.ros
def test_goals_are_canceled_before_view_is_closed_at_forced_end(
    fake_run: FakeRun, capsys: pytest.CaptureFixture[str]
) -> None:
    from sar_compiler.commands import ROBOT_MAY_MOVE
    from sar_compiler.ros.forced_end import ForcedEnd
    from sar_compiler.ros.leaves.goals import active_goals_of

    active_goals_of(fake_run.node).before_sending("01" * 16, "/drive")
    leaf: Any = Running("drive")
    leaf.status = Status.RUNNING
    leaf.terminate = lambda _: fake_run.done.append("cancelled")
    fake_run.output.leave = lambda: fake_run.done.append("closed")
    signals: Any = SimpleNamespace()
    end = ForcedEnd("sar-run", fake_run.node, leaf, signals, None, 1.0, before_message=fake_run.output.leave)
    assert end.end_immediately() == ROBOT_MAY_MOVE
    assert fake_run.done == ["cancelled", "closed"]
    assert "leaves were stopped" in capsys.readouterr().err


@pytest.mark.parametrize("wanted", [None, True, False])
@pytest.mark.parametrize("world", [None, "disaster_zone"])
@pytest.mark.parametrize("is_kept", [True, False])
def test_guardian_is_default_for_journaled_run_of_real_robot(
    monkeypatch: pytest.MonkeyPatch, wanted: bool | None, world: str | None, is_kept: bool
) -> None:
    made: list[Any] = []
    monkeypatch.setattr("sar_compiler.ros.guardian.Guardian", lambda *given: made.append(given))
    options: Any = SimpleNamespace(
        **dict.fromkeys(("properties", "view", "report", "record", "publish", "groot2"), None),
        guardian=wanted, sim=world, ros=["--enclave", "/mission"], supervision=SimpleNamespace(signs=None),
    )  # fmt: skip
    run: Any = SimpleNamespace(options=options, journal=SimpleNamespace(is_kept=is_kept), node="the node")
    for make in requested_extensions(options):
        make(run)
    is_usual = is_kept and world is None
    expected = [("the node", ["--enclave", "/mission"], None)]
    assert made == (expected if wanted or (wanted is None and is_usual) else [])
