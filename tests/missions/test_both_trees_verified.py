"""What `sar-compile verify` finds in the contract's tree and in the resilient one, and that the page tells it."""

import re
from collections.abc import Callable
from contextlib import redirect_stderr, redirect_stdout
from io import StringIO
from pathlib import Path

import pytest

from sar_compiler.cli.compile import main
from tests.docs.markdown import blocks
from tests.processes import in_order

pytestmark = pytest.mark.unmeasured

CONTRACT, RESILIENT = "trees/search_and_rescue.xml", "trees/search_and_rescue_resilient.xml"
PAGE = Path("docs/missions/search-and-rescue.md")
HOLDS = "proved"
# With a hold, or a loss of base, its states are millions.
GUARDED_SWEEPS = Path("trees/search_sweeps_guarded.xml")


def verify(tree: str | Path, *options: str) -> tuple[int, str]:
    """Return the exit status and what is printed."""
    out = StringIO()
    with redirect_stdout(out), redirect_stderr(StringIO()):
        status = main(["verify", str(tree), *options])
    return status, out.getvalue()


def broken(output: str) -> set[str]:
    """Return the questions that did not turn out well, from the table at the end."""
    table = re.findall(r"^  (\S.*?): +(proved|does not hold|not decided).*$", output, re.MULTILINE)
    assert table, output
    return {question for question, outcome in table if outcome != HOLDS}


@pytest.mark.parametrize("tree", [RESILIENT, "trees/search_areas.xml"])
def test_the_resilient_tree_and_the_one_that_chooses_are_proved_for_two_zones(tree: str) -> None:
    status, output = verify(tree, "--set", "zones_left=2")
    assert (status, broken(output)) == (0, set())


@pytest.mark.costly
def test_the_shipped_trees_that_give_zones_up_are_proved_to_give_none_up_while_nav2_is_away() -> None:
    said = {}
    for tree in sorted({*Path("trees").glob("*.xml")} - {GUARDED_SWEEPS}):
        output = verify(tree, "--set", "zones_left=1")[1]
        table = re.findall(r"^  no zone .* while Nav2 is away: +(.*)$", output, re.MULTILINE)
        said[tree.stem.removeprefix("search_and_rescue")] = "".join(table)
    left_out = "left out: this tree has no PostponeZone, no AbandonZone"
    # Failsafes alone have nothing of a mission, so that nothing of one is asked about them.
    assert said == {
        "_resilient": HOLDS,
        "_guarded": HOLDS,
        "search_areas": HOLDS,
        "search_areas_guarded": HOLDS,
        "search_sweeps": HOLDS,
        "": left_out,
        "failsafes": "",
    }


@pytest.mark.parametrize(
    "tree", [pytest.param("search_sweeps", marks=pytest.mark.costly), "search_areas_guarded"]
)
def test_the_tree_that_sweeps_and_the_guarded_search_are_proved_for_one_zone(tree: str) -> None:
    status, output = verify(f"trees/{tree}.xml", "--set", "zones_left=1")
    assert (status, broken(output)) == (0, set())


@pytest.mark.slow
def test_the_guarded_sweep_is_proved_where_nobody_holds_it_and_base_is_in_reach() -> None:
    states = ("zones_left=1", "orders_left=0", "losses_left=0")
    output = verify(GUARDED_SWEEPS, *(word for state in states for word in ("--set", state)))[1]
    assert broken(output) == {"every leaf can run"}


@pytest.mark.slow
def test_the_resilient_tree_is_proved_in_as_many_states_as_the_page_says() -> None:
    status, output = verify(RESILIENT)
    assert (status, broken(output)) == (0, set())
    states = int(re.findall(r"([\d,]+) states", output)[0].replace(",", ""))
    assert f"some {round(states, -3):,}" in " ".join(PAGE.read_text(encoding="utf-8").split())


def test_the_page_tells_the_runs_that_are_found_in_the_tree_of_the_contract() -> None:
    status, output = verify(CONTRACT)
    assert status == 1
    found = [line.strip() for line in output.splitlines()]
    told = [block.text for block in blocks(PAGE) if "does not hold" in block.text]
    assert len(told) == 3
    for run in told:
        assert in_order([line.strip() for line in run.splitlines()], found) is None, output


def without(old: str, new: str = "") -> Callable[[str], str]:
    """Replace what stands in the tree."""

    def change(text: str) -> str:
        assert old in text
        return text.replace(old, new)

    return change


# What makes the tree resilient, taken out, and what does not hold any more.
NEEDED = {
    "the oneshot": (without(' oneshot="ON_COMPLETION"'), "every run ends"),
    "the place where a report is kept": (
        without("<KeepReport/>", "<AlwaysFailure/>"),
        "one id per survivor",
    ),
    "the branch instead of a fallback": (
        lambda text: (
            text.replace("<IfThenElse", "<Fallback")
            .replace("</IfThenElse", "</Fallback")
            .replace('<IsSurvivorDetected name="IsSurvivorDetected?"/>', "")
            .replace("<BroadcastSurvivorTF/>", "<IsSurvivorDetected/><BroadcastSurvivorTF/>")
            .replace("<KeepReport/>", "<AlwaysFailure/>")
        ),
        "'no survivor' is logged only if the search found nobody",
    ),
    "the last attempt on a zone": (without('num_attempts="2"', 'num_attempts="-1"'), "every run ends"),
    "the last attempt on the way home": (without('num_attempts="5"', 'num_attempts="-1"'), "every run ends"),
    "the end where nobody could judge a drive": (
        without('<SubTree ID="EndIfUnavailable"/>'),
        "no zone is postponed or abandoned while Nav2 is away",
    ),
    "an end of postponing": (
        without('<PostponeZone attempts="3"/>', "<AlwaysSuccess/>"),
        "every run ends",
    ),
}


@pytest.mark.parametrize(("change", "question"), NEEDED.values(), ids=NEEDED)
def test_the_resilient_tree_needs(tmp_path: Path, change: Callable[[str], str], question: str) -> None:
    tree = tmp_path / "changed.xml"
    tree.write_text(change(Path(RESILIENT).read_text(encoding="utf-8")), encoding="utf-8")
    status, output = verify(tree, "--set", "zones_left=1")
    assert status == 1
    assert question in broken(output)
