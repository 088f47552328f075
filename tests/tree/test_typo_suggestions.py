"""Tests of typo suggestions: a suggestion has the same words, apart from typos."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sar_compiler.nodes.registry import default_registry
from sar_compiler.tree.guessing import nearest

NEAR = [
    ("OpenDor", "OpenDoor"),
    ("opendoor", "OpenDoor"),
    ("Open Door", "OpenDoor"),
    ("open-door", "OpenDoor"),
    ("Opendor", "OpenDoor"),
    ("Sequnce", "Sequence"),
    ("RetryUntilSuccesful", "RetryUntilSuccessful"),
    ("Look at table", "Look at Table"),
    ("NavigateZone", "NavigateToZone"),
    ("out_port", "output_port"),
    ("num_failure", "num_failures"),
    ("_failIf", "_failureIf"),
    ("goal_psoe", "goal_pose"),
    ("BroadcastSurvivorF", "BroadcastSurvivorTF"),
    ("BroadcastSurvivorFT", "BroadcastSurvivorTF"),
]
# Most pairs come from trees in public repositories, and were once suggested.
NOT_NEAR = [
    ("CheckCondition", "Condition"),
    ("CheckUserApproval", "GetUserApproval"),
    ("LogTextAction", "LogNoDetection"),
    ("MoveGoalAction", "MoveAction"),
    ("Move to Pose", "Move to Folded"),
    ("CreateVector", "Create Pose Vector"),
    ("Interpolate to Joint State", "Move to Joint State"),
    ("SetupMTCMoveToJointState", "SetupMTCFixedJointState"),
    ("PassThroughDoor", "PassThrough"),
    ("point_hold_move_posture", "point_hold_effective_posture"),
    ("GetGoal", "SetGoal"),
    ("LockDoor", "UnlockDoor"),
    ("Activate", "Deactivate"),
    ("IncreaseSpeed", "DecreaseSpeed"),
    ("zone_1", "zone_2"),
    ("_hidden", "_skipIf"),
]


@pytest.mark.parametrize(("written", "meant"), NEAR)
def test_word_with_typo_is_near(written, meant):
    assert nearest(written, ["Xyzzy", meant]) == meant


@pytest.mark.parametrize(("written", "known"), NOT_NEAR)
def test_different_word_is_not_near(written, known):
    assert nearest(written, [known]) is None
    assert nearest(known, [written]) is None


@given(
    st.sampled_from(sorted(tag for tag in default_registry().tags if len(tag) > 4 and tag.isalpha())),
    st.data(),
)
def test_extra_missing_or_swapped_letter_is_near(tag, data):
    at = data.draw(st.integers(1, len(tag) - 2))
    less, more, swapped = (
        tag[:at] + tag[at + 1 :],
        tag[:at] + tag[at].lower() + tag[at:],
        tag[:at] + tag[at + 1] + tag[at] + tag[at + 2 :],
    )
    for written in (less, more, swapped):
        assert nearest(written, ["Xyzzy", tag]) == tag
