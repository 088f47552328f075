"""What commands say only of what takes long: how long that is depends on the machine."""

import re

_PROGRESS = re.compile(
    r"^(.* \(press Ctrl-C to stop the search and see a counterexample\)|sweep: .* rows done|sar-sim: mapping .* of the route has been driven)\n",
    re.MULTILINE,
)


def without_progress(text):
    """Return what a command has said, without the progress that it tells where it is slow."""
    return _PROGRESS.sub("", text)
