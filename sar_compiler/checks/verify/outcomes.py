"""What the tick of a node can come to, in the numbers of the flat form and in the words of the answers."""

from collections.abc import Mapping

from sar_compiler.runtime.flat.cells import FAILURE, RUNNING, SKIPPED, SUCCESS

NOT_TICKED = 0
WORDS: Mapping[int, str] = {
    NOT_TICKED: "",
    RUNNING: "RUNNING",
    SUCCESS: "SUCCESS",
    FAILURE: "FAILURE",
    SKIPPED: "SKIPPED",
}
"""The word for each number; empty before the first tick."""
NUMBERS: Mapping[str, int] = {word: number for number, word in WORDS.items()}
