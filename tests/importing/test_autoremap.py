"""Subtrees whose `_autoremap` an export of BehaviorTree.CPP omits."""

from sar_compiler.importing.autoremap import with_remapped_subtrees
from sar_compiler.tree.xml import parse_xml


def remapped(body, **trees):
    """Return the IDs of the subtrees that get `_autoremap`; the main tree writes the key k."""
    others = "".join(f'<BehaviorTree ID="{name}">{inside}</BehaviorTree>' for name, inside in trees.items())
    main = f'<BehaviorTree ID="Main"><Sequence><Script code="k := 1"/>{body}</Sequence></BehaviorTree>'
    return with_remapped_subtrees(parse_xml(f'<root BTCPP_format="4">{main}{others}</root>', "tree.xml"))[1]


READS = '<AlwaysSuccess _skipIf="k == 1"/>'


def test_a_subtree_needs_it_if_a_subtree_inside_it_receives_a_key_of_the_calling_tree():
    inner = '<SubTree ID="Inner" x="{k}"/>'
    reads = READS.replace("k ==", "x ==")
    assert remapped('<SubTree ID="Outer"/>', Outer=inner, Inner=reads) == ["Outer"]
    assert remapped('<SubTree ID="Outer" k="{k}"/>', Outer=inner, Inner=reads) == []
    assert remapped('<SubTree ID="Outer"/>', Outer='<SubTree ID="Inner" k="{=}"/>', Inner=READS) == ["Outer"]
    assert remapped('<SubTree ID="Outer"/>', Outer='<SubTree ID="Inner" k="1"/>', Inner=READS) == []


def test_the_key_of_an_input_port_is_not_written():
    waits = '<Sequence><WasEntryUpdated entry="{k}"/><AlwaysSuccess _skipIf="k == 1"/></Sequence>'
    assert remapped('<SubTree ID="Waiting"/>', Waiting=waits) == ["Waiting"]
    writes = '<Sequence><SetBlackboard value="1" output_key="k"/><AlwaysSuccess _skipIf="k == 1"/></Sequence>'
    assert remapped('<SubTree ID="Writing"/>', Writing=writes) == []
