"""BehaVerify's benchmark: a binary tree with n = 2^LEVELS conditions, and what must hold of it.

    python -m benchmarks.binary_tree 5 FOLDER    # writes binary_5.xml and binary_5.yaml there

The root is a sequence: a leaf that may count `vv` down, a binary tree of fallbacks with a condition for each value of `vv`,
and a leaf that may count it up. The leaves are described by a palette in the tree file, and their answers in the
file of properties. It is the tree of the comparison with MoVe4BT in the reproducibility package of BehaVerify
(https://github.com/verivital/behaverify).
"""

import sys
from pathlib import Path

from benchmarks.trees import around, document

PALETTE = '<TreeNodesModel>\n<Action ID="Inc"/>\n<Action ID="Dec"/>\n</TreeNodesModel>\n</root>'


def nodes(levels: int) -> int:
    """Return how many nodes the tree has."""
    return int(2 ** (levels + 1)) + 7


def tree(levels: int) -> str:
    """Return the tree file."""
    most = 2**levels
    level = [_is(value) for value in range(most)]
    while len(level) > 1:
        level = [around("Fallback", pair) for pair in zip(level[::2], level[1::2], strict=True)]
    down = around("Fallback", [_is(0), _is(most), "<Dec/>"])
    up = around("Fallback", [_is(most), "<Inc/>"])
    return document(around("Sequence", [down, *level, up])).replace("</root>", PALETTE)


def properties(levels: int) -> str:
    """Return the file of properties."""
    return f"""\
end: none
parameters: {{vv: 0}}
answers:
  Inc: [{{status: SUCCESS, label: counted, then: "vv = vv + 1"}}, FAILURE]
  Dec: [SUCCESS, {{status: FAILURE, label: counted, then: "vv = vv - 1"}}]
properties:
  at the end of the count nothing counts any more:
    never: [Inc starts, Dec starts]
    while: vv == {2**levels}
"""


def write(levels: int, folder: Path) -> tuple[Path, Path]:
    """Write both files; return their paths."""
    paths = folder / f"binary_{levels}.xml", folder / f"binary_{levels}.yaml"
    for path, text in zip(paths, (tree(levels), properties(levels)), strict=True):
        path.write_text(text, encoding="utf-8")
    return paths


def _is(value: int) -> str:
    return f'<ScriptCondition code="vv == {value}"/>'


if __name__ == "__main__":
    write(int(sys.argv[1]), Path(sys.argv[2]))
