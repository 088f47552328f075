"""Draw the pictures of trees: `python docs/pictures/trees.py` in the project's folder writes them beside this file."""

from pathlib import Path

from sar_compiler.testing import compiled
from sar_compiler.views.drawing import svg

TREES = {
    "trees/search_and_rescue.xml": (),
    "trees/search_and_rescue_resilient.xml": (),
    "trees/search_and_rescue_guarded.xml": (),
    "examples/decorators/retry.xml": ("examples.decorators.leaves",),
}
"""The trees, with the modules that have their leaves."""


def pictures() -> dict[Path, str]:
    """Return what each picture is to be, by its path."""
    folder = Path(__file__).parent
    return {
        folder / f"{Path(tree).stem}.svg": svg(compiled(Path(tree), nodes=nodes))
        for tree, nodes in TREES.items()
    }


if __name__ == "__main__":
    for path, text in pictures().items():
        path.write_text(text, encoding="utf-8")
