"""Scenarios as JUnit's XML, which continuous integration shows as tests."""

import io
from collections.abc import Sequence
from dataclasses import dataclass, field
from xml.sax.saxutils import XMLGenerator

from sar_compiler.checks.simulate.judging import Failure
from sar_compiler.checks.simulate.running import Run
from sar_compiler.views.plain import speakable
from sar_compiler.views.trace import failure_line, trace


@dataclass(frozen=True)
class PlayedScenario:
    """A scenario that was played, or is invalid.

    Attributes:
        name: Its name.
        run: Its run; None if it is invalid.
        failures: The expectations that were not met.
        problem: The reason why it is invalid.
        is_undecided: Whether that is not its own fault, but that nobody knows what a node of the tree does.
    """

    name: str
    run: Run | None = None
    failures: Sequence[Failure] = field(default_factory=tuple)
    problem: str = ""
    is_undecided: bool = False


def junit(tree: str, scenarios: Sequence[PlayedScenario]) -> str:
    """Return a test suite for a tree file, with a test case for each scenario; times are simulated seconds."""
    stream = io.StringIO()
    xml = XMLGenerator(stream, "UTF-8", short_empty_elements=True)
    counts = {
        "tests": str(len(scenarios)),
        "failures": str(sum(bool(each.failures) for each in scenarios)),
        "errors": str(sum(each.run is None for each in scenarios)),
        "time": f"{sum(each.run.time_sec for each in scenarios if each.run):.3f}",
    }
    xml.startDocument()
    _start(xml, "testsuites", counts)
    _start(xml, "testsuite", {"name": tree, **counts})
    for each in scenarios:
        _case(xml, tree, each)
    for tag in ("testsuite", "testsuites"):
        xml.ignorableWhitespace("\n")
        xml.endElement(tag)
    return stream.getvalue().replace("?>\n\n", "?>\n") + "\n"


def _case(xml: XMLGenerator, tree: str, played: PlayedScenario) -> None:
    run = played.run
    time_sec = f"{run.time_sec:.3f}" if run else "0.000"
    _start(xml, "testcase", {"name": played.name, "classname": tree, "time": time_sec})
    if run is None:
        _text(xml, "error", played.problem, {"message": "the scenario cannot be played"})
    elif played.failures:
        lines = [failure_line(run, failure) for failure in played.failures]
        text = "\n".join([*lines, "", trace(run)])
        _text(xml, "failure", text, {"message": lines[0], "type": played.failures[0].expected})
    else:
        _text(xml, "system-out", trace(run), {})
    xml.endElement("testcase")


def _text(xml: XMLGenerator, tag: str, text: str, attributes: dict[str, str]) -> None:
    _start(xml, tag, attributes)
    xml.characters(speakable(text))
    xml.endElement(tag)


def _start(xml: XMLGenerator, tag: str, attributes: dict[str, str]) -> None:
    xml.ignorableWhitespace("\n")
    xml.startElement(tag, {name: speakable(text) for name, text in attributes.items()})  # type: ignore[arg-type]
