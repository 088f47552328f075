"""Tests of the results of `sar-compile verify` for the shipped trees, and of their description on the page."""

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
# With pauses or losses of base it has millions of states.
GUARDED_SWEEPS = Path("trees/search_sweeps_guarded.xml")


def verify(tree: str | Path, *options: str) -> tuple[int, str]:
    """Run `sar-compile verify`, and return the exit status and the output."""
    out = StringIO()
    with redirect_stdout(out), redirect_stderr(StringIO()):
        status = main(["verify", str(tree), *options])
    return status, out.getvalue()


def broken(output: str) -> set[str]:
    """Return the properties that were not proved, from the table at the end."""
    table = re.findall(r"^  (\S.*?): +(proved|does not hold|not decided).*$", output, re.MULTILINE)
    assert table, output
    return {question for question, outcome in table if outcome != HOLDS}


@pytest.mark.parametrize("tree", [RESILIENT, "trees/search_areas.xml"])
def test_resilient_and_choosing_trees_are_proved_for_two_zones(tree: str) -> None:
    status, output = verify(tree, "--set", "zones_left=2")
    assert (status, broken(output)) == (0, set())


@pytest.mark.costly
def test_shipped_trees_give_up_no_zone_while_nav2_is_away() -> None:
    said = {}
    for tree in sorted({*Path("trees").glob("*.xml")} - {GUARDED_SWEEPS}):
        output = verify(tree, "--set", "zones_left=1")[1]
        table = re.findall(r"^  no zone .* while Nav2 is away: +(.*)$", output, re.MULTILINE)
        said[tree.stem.removeprefix("search_and_rescue")] = "".join(table)
    left_out = "left out: this tree has no PostponeZone, no AbandonZone"
    # The failsafes tree has no leaves of the mission, so this property is not checked.
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
def test_sweeping_and_guarded_trees_are_proved_for_one_zone(tree: str) -> None:
    status, output = verify(f"trees/{tree}.xml", "--set", "zones_left=1")
    assert (status, broken(output)) == (0, set())


@pytest.mark.slow
def test_guarded_sweep_is_proved_without_commands_and_losses_of_base() -> None:
    states = ("zones_left=1", "orders_left=0", "losses_left=0")
    output = verify(GUARDED_SWEEPS, *(word for state in states for word in ("--set", state)))[1]
    assert broken(output) == {"every leaf can run"}


@pytest.mark.slow
def test_resilient_tree_is_proved_in_number_of_states_on_page() -> None:
    status, output = verify(RESILIENT)
    assert (status, broken(output)) == (0, set())
    states = int(re.findall(r"([\d,]+) states", output)[0].replace(",", ""))
    assert f"some {round(states, -3):,}" in " ".join(PAGE.read_text(encoding="utf-8").split())


def test_page_shows_counterexamples_of_contract_tree() -> None:
    status, output = verify(CONTRACT)
    assert status == 1
    found = [line.strip() for line in output.splitlines()]
    shown_runs = [block.text for block in blocks(PAGE) if "does not hold" in block.text]
    assert len(shown_runs) == 3
    for run in shown_runs:
        assert in_order([line.strip() for line in run.splitlines()], found) is None, output


def replace_in_tree(old: str, new: str = "") -> Callable[[str], str]:
    """Return a function that replaces text of the tree."""

    def change(text: str) -> str:
        assert old in text
        return text.replace(old, new)

    return change


# Each safeguard of the resilient tree: its removal, and the property that is then violated.
SAFEGUARDS = {
    "oneshot of mission": (replace_in_tree(' oneshot="ON_COMPLETION"'), "every run ends"),
    "storing a report": (
        replace_in_tree("<KeepReport/>", "<AlwaysFailure/>"),
        "one id per survivor",
    ),
    "branch instead of fallback": (
        lambda text: (
            text.replace("<IfThenElse", "<Fallback")
            .replace("</IfThenElse", "</Fallback")
            .replace('<IsSurvivorDetected name="IsSurvivorDetected?"/>', "")
            .replace("<BroadcastSurvivorTF/>", "<IsSurvivorDetected/><BroadcastSurvivorTF/>")
            .replace("<KeepReport/>", "<AlwaysFailure/>")
        ),
        "'no survivor' is logged only if the search found nobody",
    ),
    "limited attempts on a zone": (
        replace_in_tree('num_attempts="2"', 'num_attempts="-1"'),
        "every run ends",
    ),
    "limited attempts on the way home": (
        replace_in_tree('num_attempts="5"', 'num_attempts="-1"'),
        "every run ends",
    ),
    "end while navigation is unavailable": (
        replace_in_tree('<SubTree ID="EndIfUnavailable"/>'),
        "no zone is postponed or abandoned while Nav2 is away",
    ),
    "limited postponing": (
        replace_in_tree('<PostponeZone attempts="3"/>', "<AlwaysSuccess/>"),
        "every run ends",
    ),
}


@pytest.mark.parametrize(("change", "question"), SAFEGUARDS.values(), ids=SAFEGUARDS)
def test_removing_safeguard_violates_property(
    tmp_path: Path, change: Callable[[str], str], question: str
) -> None:
    tree = tmp_path / "changed.xml"
    tree.write_text(change(Path(RESILIENT).read_text(encoding="utf-8")), encoding="utf-8")
    status, output = verify(tree, "--set", "zones_left=1")
    assert status == 1
    assert question in broken(output)
