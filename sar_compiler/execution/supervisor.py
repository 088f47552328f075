"""`sar-run --supervise`: starts a run of the mission, and resumes it after a crash."""

import json
import os
import signal
import subprocess
import threading
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING

from sar_compiler.commands import ROBOT_MAY_MOVE, print_error
from sar_compiler.errors import SarError
from sar_compiler.execution.supervision import (
    ALIVE,
    DEAF,
    ENDING,
    JOURNAL,
    NOT_READY,
    Supervision,
)
from sar_compiler.journal.errors import JournalError
from sar_compiler.ros.guardian import MAY_MOVE_SIGN
from sar_compiler.ros.signals import StopSignals

if TYPE_CHECKING:
    from sar_compiler.journal.journal_entries import JournalRun

# Maximum time, in seconds, without a message from a ticking run, which sends a heartbeat every second. The second, longer limit applies before
# the first heartbeat and while reports are written.
_SILENCE_SEC, _PATIENCE_SEC = 10.0, 60.0
_TURN_SEC = 0.2
# If an iteration takes longer than this, in seconds, the supervisor itself was suspended, and the wait for a heartbeat starts over.
_OWN_PAUSE_SEC = 2.0
# Maximum time for the guardian of a crashed run to end the goals and itself, in seconds.
_GUARDIAN_SEC = 20.0
_LOCK_SEC = 10.0
_LAST_WORDS_SEC = 0.9


def supervise(
    argv: Sequence[str], limit: int, signals: StopSignals, report: Callable[[Path], object] | None = None
) -> int:
    """Run a mission until it ends, resume it after each crash, and return the exit status.

    A run has crashed if it was ended by a signal that was not requested, or if it exited with status 3. The supervisor kills a run that
    sends no heartbeat for 10 s, or that reports the loss of discovery. The guardian then cancels the run's goals. The next run starts when
    the goals have ended and the journal is unlocked.

    Args:
        argv: The command line of a run, with the program.
        limit: The maximum number of restarts.
        signals: The requests to stop, which are passed on to the run.
        report: Writes the reports that a run could not write before its process ended. The argument is the path of the run's journal. None
            if no reports are requested.
    """
    deaths: list[str] = []
    has_begun = False
    while True:
        life = _SupervisedRun(argv, deaths, has_begun=has_begun)
        signals.last_words = lambda life=life: life.stop_immediately(signals)
        life.wait_for_end(signals)
        status, death = life.collect_exit()
        if life.may_move:
            print_error("sar-run: the mission has crashed, and one of its goals may still be active")
            return ROBOT_MAY_MOVE
        if signals.came and death:
            return signals.exit_status
        if not death:
            life.write_missing_reports(report)
            return signals.exit_status if signals.came and status > 128 else status  # noqa: PLR2004
        if len(deaths) == limit:
            print_error(f"sar-run: the mission has crashed ({death}) after {limit} restarts")
            return status
        deaths.append(death)
        has_begun = has_begun or life.has_begun
        how = "resumed" if has_begun else "restarted"
        print_error(f"sar-run: the mission has crashed ({death}) and is {how} ({len(deaths)} of {limit})")


class _SupervisedRun:
    """One run of the mission in its own process.

    Args:
        argv: The command line of the run, with the program.
        deaths: How the earlier runs crashed, in words.
        has_begun: Whether to resume the mission.

    Attributes:
        may_move: Whether a goal of the run may still be active.
    """

    def __init__(self, argv: Sequence[str], deaths: Sequence[str], *, has_begun: bool) -> None:
        self.may_move = False
        self._began = time.time()
        signs, theirs = os.pipe()
        handed = Supervision(theirs, deaths, has_begun).environment()
        self._process = subprocess.Popen(  # noqa: S603 - this interpreter, and the user's own command line
            argv,
            env={**os.environ, **handed},
            # Ctrl-C would reach the run twice: from the terminal's process group, and from the supervisor.
            start_new_session=True,
            pass_fds=(theirs,),
        )
        os.close(theirs)
        self._has_sent = self._is_frozen = self._is_deaf = False
        self._limit_sec = _PATIENCE_SEC
        self._heard_at = time.monotonic()
        self._place: Path | None = None
        self._listener = threading.Thread(target=self._listen, args=(signs,), daemon=True)
        self._listener.start()

    def wait_for_end(self, signals: StopSignals) -> None:
        """Wait until the run ends; kill the run if its heartbeat stops, and pass on requests to stop."""
        is_asked = False
        turned_at = time.monotonic()
        while self._is_alive():
            now = time.monotonic()
            if now - turned_at > _OWN_PAUSE_SEC:
                self._heard_at = now
            turned_at = now
            if signals.came and not is_asked:
                is_asked = True
                self._request_stop(signals)
            if self._is_deaf or now - self._heard_at > self._limit_sec:
                self._is_frozen = not self._is_deaf
                self._process.kill()
                self._process.wait()
        # The next run must not start while the last one is active, because two missions would command one robot. A blocked process is therefore
        # killed, because it could continue later. After that, its guardian still cancels goals. The guardian has inherited the pipe. So the pipe
        # closes, and the listener ends, only when the guardian has ended. The journal may be locked for a moment longer. Both waits have a limit.
        self._listener.join(_GUARDIAN_SEC)
        if (place := self._place) is not None:
            from sar_compiler.journal.database import is_locked

            deadline = time.monotonic() + _LOCK_SEC
            while is_locked(place) and time.monotonic() < deadline:
                time.sleep(_TURN_SEC)

    def collect_exit(self) -> tuple[int, str]:
        """Return the exit status and a description of the crash. The description is empty without a crash."""
        status = self._process.returncode
        # The journal takes precedence over the process: a run that has recorded its end is over, even if native code crashed while ROS was
        # shut down. Resuming the run would repeat a finished mission.
        ended = self._run_in_journal()
        if ended is not None and ended.status is not None and ended.status != NOT_READY:
            return ended.status, ""
        if self._is_deaf:
            return (
                NOT_READY,
                "the process no longer received messages from Nav2, although the ROS graph shows Nav2",
            )
        if self._is_frozen:
            return 128 + signal.SIGKILL, f"no heartbeat for {self._limit_sec:g} s"
        if status < 0:
            return 128 - status, f"by {signal.Signals(-status).name}"
        return status, "exit status 3, because a requirement was missing" if status == NOT_READY else ""

    def write_missing_reports(self, report: Callable[[Path], object] | None) -> None:
        """Write the reports of a finished run if the process crashed before it could write them."""
        if report is None or self._place is None or self._process.returncode >= 0:
            return
        try:
            report(self._place)
        except (SarError, ImportError) as error:
            print_error(f"sar-run: the mission has ended, but the report could not be written: {error}")

    @property
    def has_begun(self) -> bool:
        """Whether the mission has started in this run, so that the mission can be resumed."""
        return self._run_in_journal() is not None

    def stop_immediately(self, signals: StopSignals) -> int | None:
        """Pass on a second request to stop; return the exit status if the run ends immediately."""
        self._request_stop(signals)
        with suppress(subprocess.TimeoutExpired):
            status = self._process.wait(_LAST_WORDS_SEC)
            return status if status >= 0 else None
        return None

    def _request_stop(self, signals: StopSignals) -> None:
        # Before its first message, the process may not have installed its SIGINT handler: Python would print a traceback.
        self._process.send_signal(signals.exit_status - 128 if self._has_sent else signal.SIGTERM)

    def _is_alive(self) -> bool:
        """Wait up to one interval for the run to end; return whether the run is still active."""
        with suppress(subprocess.TimeoutExpired):
            self._process.wait(_TURN_SEC)
        return self._process.returncode is None

    def _listen(self, signs: int) -> None:
        """Process the messages of the run and its guardian until the pipe is closed."""
        with open(signs, "rb") as lines:
            for line in lines:
                self._handle_line(line)

    def _handle_line(self, line: bytes) -> None:
        self._has_sent, self._heard_at = True, time.monotonic()
        if line.startswith(ALIVE):
            self._limit_sec = _SILENCE_SEC
        elif line.startswith(ENDING):
            self._limit_sec = _PATIENCE_SEC
        elif line.startswith(DEAF):
            self._is_deaf = True
        elif line.startswith(JOURNAL):
            self._place = Path(json.loads(line[1:]))
        self.may_move = self.may_move or line.startswith(MAY_MOVE_SIGN)

    def _run_in_journal(self) -> "JournalRun | None":
        """Return the record of this run in the journal; None if the journal has no such record."""
        from sar_compiler.journal.database import JournalFile

        if self._place is None:
            return None
        try:
            with JournalFile.open_snapshot(self._place) as file:
                last = file.runs()[-1:]
        except JournalError:
            return None
        # An earlier run may have had the same process ID.
        own = (
            each for each in last if each.about.get("pid") == self._process.pid and each.began >= self._began
        )
        return next(own, None)
