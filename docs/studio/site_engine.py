"""The responses to the requests of the graphical editor on the site, where Python runs in the browser.

One file is open at a time, in the browser's memory. The request `put` opens another file.
"""

import json
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

from sar_compiler.project import CommandLineSettings
from sar_compiler.studio.tree_studio import Studio

_ADDITIONS = CommandLineSettings(models=(Path("nav2:jazzy"),), is_isolated=True)
# In a browser, Python explores about 170 states per second.
_MOST_STATES = 50_000


class SiteStudio:
    """Answers the page's requests about the file that was opened last."""

    def __init__(self) -> None:
        self._folder = Path(tempfile.mkdtemp())
        self._studio: Studio | None = None
        self._on_progress: Callable[[int], object] = lambda _states: None

    def answer(self, question: str, values: str, on_progress: Callable[[int], object]) -> str:
        """Return the response to a request in JSON, given the request's values in JSON."""
        said: dict[str, Any] = json.loads(values)
        self._on_progress = on_progress
        if question == "put" or self._studio is None:
            path = self._folder / Path(said["name"]).name
            path.write_text(said["text"], encoding="utf-8", newline="")
            self._studio = Studio(path, _ADDITIONS, _MOST_STATES, self._report)
            return "{}"
        return json.dumps(self._studio.answer_question(question, said))

    def _report(self, states: int) -> None:
        self._on_progress(states)


answer = SiteStudio().answer
