"""Progress messages, which commands print only if a step is slow on this machine."""

import re

_PROGRESS = re.compile(
    r"^(.* \(press Ctrl-C to stop the search and see a counterexample\)|sweep: .* rows done|sar-sim: mapping .* of the route has been driven)\n",
    re.MULTILINE,
)


def without_progress(text):
    """Return the output of a command without progress messages."""
    return _PROGRESS.sub("", text)
