"""Programs that run `sar-run` and kill themselves with SIGKILL: start them with `python -c`."""

KILLER = """
import os, signal, sys
from sar_compiler.cli.run import main
from sar_compiler.journal.database import JournalFile

dies_at, written = int(sys.argv[1]), sys.argv[2] == "written"
write, facts = JournalFile.write, 0

def write_or_die(self, watched, noted=(), end=None):
    global facts
    facts += len(noted)
    dies = bool(noted) and facts == dies_at
    if dies and not written:
        os.kill(os.getpid(), signal.SIGKILL)
    write(self, watched, noted, end)
    if dies:
        os.kill(os.getpid(), signal.SIGKILL)

JournalFile.write = write_or_die
sys.exit(main(sys.argv[3:]))
"""
"""Kills itself at its Nth event. Arguments: N, `written` (after writing it) or any other word (before), those of sar-run."""

TIMED_KILLER = """
import os, signal, sys, threading
from sar_compiler.cli.run import main
from sar_compiler.journal.database import JournalFile

begin_run = JournalFile.begin_run

def begin_and_die(self, *about):
    number = begin_run(self, *about)
    timer = threading.Timer(float(sys.argv[1]), os.kill, (os.getpid(), signal.SIGKILL))
    timer.daemon = True
    timer.start()
    return number

JournalFile.begin_run = begin_and_die
sys.exit(main(sys.argv[2:]))
"""
"""Kills itself some seconds after the start of its journal. Arguments: the seconds, those of sar-run."""
