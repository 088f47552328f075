"""The tree of the contract, held here in words: golden files follow a changed tree when they are renewed."""

from pathlib import Path

import pytest

from sar_compiler.compiler.outline import outline
from sar_compiler.testing import compile_for_test

# What a node is, its name, and its memory or policy; indented by its depth.
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
    """Yield a compiled node and those below it, a line each."""
    flags = [str(node[key]) for key in ("memory", "policy") if key in node]
    yield "  " * depth + " ".join([node["class"].rpartition(".")[2], node["name"], *flags])
    for child in node["children"]:
        yield from lines(child, depth + 1)


@pytest.mark.parametrize("form", [".xml", ".yaml"])
def test_the_shipped_mission_is_the_tree_of_the_contract(form):
    drawn = lines(outline(compile_for_test(Path("trees/search_and_rescue").with_suffix(form))))
    assert "".join(f"{line}\n" for line in drawn) == CONTRACT


def test_its_golden_file_is_the_tree_of_the_contract():
    golden = Path("tests/golden/search_and_rescue.txt").read_text(encoding="utf-8").splitlines()
    names = [line.split()[1] for line in CONTRACT.splitlines()]
    assert [line.split()[-1] for line in golden] == names
