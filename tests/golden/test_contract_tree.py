"""Tests that the shipped mission is the tree of the contract. It is written out here because golden files can be renewed."""

from pathlib import Path

import pytest

from sar_compiler.compiler.outline import outline
from sar_compiler.testing import compile_for_test

# The class of each node, its name, and its memory flag or policy, indented by depth.
CONTRACT = """\
Selector MissionOrReturnToBase False
  Sequence Patrol True
    ZonesRemaining ZonesRemaining?
    NavigateToZone NavigateToZone
    DetectSurvivor DetectSurvivor
    Selector HandleDetection False
      Sequence SurvivorFound True
        IsSurvivorDetected IsSurvivorDetected?
        BroadcastSurvivorTF BroadcastSurvivorTF
        NotifyBase NotifyBase
      LogNoDetection LogNoDetection
    AdvanceZone AdvanceZone
  OneShot NavigateToBaseOneShot ON_COMPLETION
    NavigateToBase NavigateToBase
"""


def lines(node, depth=0):
    """Yield a line for a compiled node and for each of its descendants."""
    flags = [str(node[key]) for key in ("memory", "policy") if key in node]
    yield "  " * depth + " ".join([node["class"].rpartition(".")[2], node["name"], *flags])
    for child in node["children"]:
        yield from lines(child, depth + 1)


@pytest.mark.parametrize("form", [".xml", ".yaml"])
def test_shipped_mission_matches_the_contract(form):
    drawn = lines(outline(compile_for_test(Path("trees/search_and_rescue").with_suffix(form))))
    assert "".join(f"{line}\n" for line in drawn) == CONTRACT


def test_golden_file_matches_the_contract():
    golden = Path("tests/golden/search_and_rescue.txt").read_text(encoding="utf-8").splitlines()
    names = [line.split()[1] for line in CONTRACT.splitlines()]
    assert [line.split()[-1] for line in golden] == names
