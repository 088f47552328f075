"""`sar-run --approved` starts what was approved, and nothing else."""

import pytest

from tests.trees import document

pytestmark = pytest.mark.ros


@pytest.fixture
def tree(tmp_path):
    path = tmp_path / "tree.xml"
    path.write_text(document("<AlwaysSuccess/>"), encoding="utf-8")
    return path


@pytest.fixture
def state(tmp_path):
    return {"XDG_STATE_HOME": str(tmp_path / "state")}


def test_a_tree_flies_only_as_it_was_approved(start, tree, state):
    def fly():
        run = start("sar-run", tree, "--approved", env=state)
        return run.end(), run.output

    status, said = fly()
    assert (status, "is not approved, and --approved starts nothing else" in said) == (2, True)
    assert start("sar-compile", "approve", tree, "--by", "Ada", env=state).end() == 0
    assert fly() == (0, "")
    tree.write_text(document("<AlwaysFailure/>"), encoding="utf-8")
    status, said = fly()
    assert (status, "tree.xml has changed; look at it, then: sar-compile approve" in said) == (2, True)
