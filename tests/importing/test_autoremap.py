"""Tests of subtrees whose `_autoremap` is omitted by an export of BehaviorTree.CPP."""

from sar_compiler.importing.autoremap import with_remapped_subtrees
from sar_compiler.tree.xml import parse_xml


def remapped_subtrees(body, **trees):
    """Return the IDs of the subtrees that get `_autoremap`; the main tree writes the key k."""
    others = "".join(f'<BehaviorTree ID="{name}">{inside}</BehaviorTree>' for name, inside in trees.items())
    main = f'<BehaviorTree ID="Main"><Sequence><Script code="k := 1"/>{body}</Sequence></BehaviorTree>'
    return with_remapped_subtrees(parse_xml(f'<root BTCPP_format="4">{main}{others}</root>', "tree.xml"))[1]


READS = '<AlwaysSuccess _skipIf="k == 1"/>'


def test_subtree_is_remapped_if_inner_subtree_receives_key_of_calling_tree():
    inner = '<SubTree ID="Inner" x="{k}"/>'
    reads = READS.replace("k ==", "x ==")
    assert remapped_subtrees('<SubTree ID="Outer"/>', Outer=inner, Inner=reads) == ["Outer"]
    assert remapped_subtrees('<SubTree ID="Outer" k="{k}"/>', Outer=inner, Inner=reads) == []
    assert remapped_subtrees('<SubTree ID="Outer"/>', Outer='<SubTree ID="Inner" k="{=}"/>', Inner=READS) == [
        "Outer"
    ]
    assert remapped_subtrees('<SubTree ID="Outer"/>', Outer='<SubTree ID="Inner" k="1"/>', Inner=READS) == []


def test_key_of_input_port_is_not_written():
    waits = '<Sequence><WasEntryUpdated entry="{k}"/><AlwaysSuccess _skipIf="k == 1"/></Sequence>'
    assert remapped_subtrees('<SubTree ID="Waiting"/>', Waiting=waits) == ["Waiting"]
    writes = '<Sequence><SetBlackboard value="1" output_key="k"/><AlwaysSuccess _skipIf="k == 1"/></Sequence>'
    assert remapped_subtrees('<SubTree ID="Writing"/>', Writing=writes) == []
