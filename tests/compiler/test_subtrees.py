"""Which entry of the blackboard a key means, in trees within trees."""

import gc
import math

import pytest
from hypothesis import given
from hypothesis import strategies as st
from py_trees.behaviour import Behaviour
from py_trees.blackboard import Blackboard
from py_trees.common import Status
from py_trees.composites import Sequence

from sar_compiler.compiler import bind_main, compile_tree
from sar_compiler.nodes.registry import Registry, default_registry
from sar_compiler.nodes.spec import Kind, NodeSpec
from sar_compiler.tree.diagnostic import TreeError
from tests.trees import forest_of


class Fixed(Behaviour):
    def __init__(self, name: str, speed: float) -> None:
        super().__init__(name)
        self.speed = speed

    def update(self) -> Status:
        return Status.SUCCESS


REGISTRY = Registry([*default_registry().specs(), NodeSpec("Fixed", Fixed, Kind.ACTION)])


def compiled(main, parameters=None, **trees):
    others = "".join(f'<BehaviorTree ID="{name}">{body}</BehaviorTree>\n' for name, body in trees.items())
    text = (
        f'<root main_tree_to_execute="Main">\n<BehaviorTree ID="Main">{main}</BehaviorTree>\n{others}</root>'
    )
    return compile_tree(bind_main(forest_of(text), REGISTRY), {}, parameters or {})


def after(main, parameters=None, **trees):
    """Return the keys of the main tree and their values after one tick."""
    tree = compiled(main, parameters, **trees)
    tree.root.tick_once()
    return own(tree)


def own(tree):
    prefix = f"{tree.board.prefix}/"
    names = [name.removeprefix(prefix) for name in tree.board.names()]
    return {name: tree.board.get(prefix + name) for name in names if "/" not in name}


def test_a_key_of_a_subtree_is_its_own():
    assert after('<SubTree ID="B"/>', B='<Script code="x := 1"/>') == {}


def test_a_key_that_is_passed_on_is_the_one_around():
    assert after('<SubTree ID="B" x="{y}"/>', B='<Script code="x := 1"/>') == {"y": 1}


def test_a_key_may_be_passed_on_under_its_own_name():
    assert after('<SubTree ID="B" x="{=}"/>', B='<Script code="x := 1"/>') == {"x": 1}


def test_a_key_is_passed_on_through_every_tree_between():
    inner = {"B": '<SubTree ID="C" z="{x}"/>', "C": '<Script code="z := 1"/>'}
    assert after('<SubTree ID="B" x="{y}"/>', **inner) == {"y": 1}


def test_what_one_tree_between_keeps_ends_there():
    inner = {"B": '<SubTree ID="C" z="{kept}"/>', "C": '<Script code="z := 1"/>'}
    assert after('<SubTree ID="B" x="{y}"/>', **inner) == {}


def test_autoremap_passes_every_key_on_but_private_ones():
    assert after('<SubTree ID="B" _autoremap="true"/>', B='<Script code="x := 1; _y := 2"/>') == {"x": 1}


def test_a_key_that_is_passed_on_by_name_wins_over_autoremap():
    assert after('<SubTree ID="B" x="{z}" _autoremap="true"/>', B='<Script code="x := 1; y := 2"/>') == {
        "z": 1,
        "y": 2,
    }


def test_a_constant_is_the_subtrees_own_whatever_autoremap_says():
    assert after(
        '<Sequence><Script code="x := 5"/><SubTree ID="B" x="7" _autoremap="true"/></Sequence>',
        B='<Script code="seen := x; x := 8"/>',
    ) == {"x": 5, "seen": 7}


def test_names_with_strokes_do_not_bring_two_subtrees_together():
    tree = compiled(
        '<Sequence><SubTree ID="B" name="a/b"/><SubTree ID="C" name="a"/></Sequence>',
        B='<Script code="x := 1"/>',
        C='<SubTree ID="D" name="b"/>',
        D="<Success/>",
    )
    tree.root.tick_once()
    first, second = tree.instance.inner.values()
    assert first.scope.resolve("x").read() == 1
    (innermost,) = second.inner.values()
    assert not innermost.scope.resolve("x").exists


class Inside(Behaviour):
    def __init__(self, name: str, around: Sequence) -> None:
        super().__init__(name)

    def update(self) -> Status:
        return Status.SUCCESS


@pytest.mark.parametrize("levels", [1, 2])
def test_a_node_in_a_subtree_that_refers_to_what_the_subtree_stands_in_is_a_finding(levels):
    registry = Registry([*REGISTRY.specs(), NodeSpec("Inside", Inside, Kind.ACTION)])
    inner = ['<SubTree ID="T1"/>', "<Inside/>"][2 - levels :]
    trees = "".join(
        f'<BehaviorTree ID="T{number}">{body}</BehaviorTree>' for number, body in enumerate(inner)
    )
    text = f'<root main_tree_to_execute="Main"><BehaviorTree ID="Main"><Sequence><SubTree ID="T0"/></Sequence></BehaviorTree>{trees}</root>'
    with pytest.raises(
        TreeError, match="'Inside' refers to 'Sequence', which is created after the subtree of 'Inside'"
    ):
        bind_main(forest_of(text), registry)


def test_what_a_text_port_reads_is_the_text_that_the_subtree_is_given():
    body = '<Switch2 variable="{zone}" case_1="7" case_2="8"><Failure/><Success/><Failure/></Switch2>'
    tree = compiled('<SubTree ID="B"/>', B='<SubTree ID="C" zone="007" count="007"/>', C=body)
    (outer,) = tree.instance.inner.values()
    (inner,) = outer.inner.values()
    assert [inner.scope.resolve(key).read() for key in ("zone", "count")] == ["007", 7]


@pytest.mark.parametrize("name", ["b", "b::1"])
def test_two_subtrees_of_one_name_have_keys_of_their_own(name):
    main = f'<Sequence><SubTree ID="B" name="{name}" x="1"/><SubTree ID="B" name="{name}" x="2"/></Sequence>'
    tree = compiled(main, B='<Script code="y := x"/>')
    tree.root.tick_once()
    assert [inner.scope.resolve("y").read() for inner in tree.instance.inner.values()] == [1, 2]


def test_an_equals_sign_is_a_text_for_a_subtree():
    assert after('<SubTree ID="B" x="=" y="{=}"/>', B='<Script code="y := x"/>') == {"y": "="}


def test_every_port_names_an_entry_that_a_script_can_write():
    tree = '<Sequence><Script code="n = 1"/><SubTree ID="B" m="{n}"/></Sequence>'
    assert after(tree, B='<WasEntryUpdated entry="{m}"/>') == {"n": 1}


@pytest.mark.parametrize(
    ("text", "value"),
    [("7", 7), ("1e3", 1000.0), ("+7", "+7"), ("-inf", -math.inf), ("true", "true"), ("a b", "a b")],
)
def test_a_constant_has_the_type_that_its_text_shows(text, value):
    seen = after(f'<SubTree ID="B" x="{text}"/>', B='<Script code="@seen := x"/>')["seen"]
    assert seen == value


def test_a_key_of_the_root_is_written_with_an_at_sign_anywhere():
    inner = {"B": '<SubTree ID="C"/>', "C": '<Script code="@x := 1"/>'}
    assert after('<SubTree ID="B"/>', **inner) == {"x": 1}


def test_a_key_of_the_root_can_be_passed_on():
    inner = {"B": '<SubTree ID="C" z="{@far}"/>', "C": '<Script code="z := 1"/>'}
    assert after('<SubTree ID="B"/>', **inner) == {"far": 1}


def test_instances_of_one_tree_have_keys_of_their_own():
    tree = compiled(
        '<Sequence><SubTree ID="B" name="a" me="1"/><SubTree ID="B" name="b" me="2"/></Sequence>',
        B='<Script code="kept := me"/>',
    )
    tree.root.tick_once()
    assert [inner.scope.resolve("kept").read() for inner in tree.instance.inner.values()] == [1, 2]


def test_parameters_of_the_mission_are_keys_of_the_root():
    tree = compiled('<SubTree ID="B" v="{speed}"/>', {"speed": 2, "goal": "x"}, B='<Fixed speed="{v}"/>')
    assert own(tree) == {"speed": 2, "goal": "x"}
    assert [node.speed for node in tree.root.iterate() if isinstance(node, Fixed)] == [2.0]


def test_an_attribute_that_is_fixed_takes_a_constant_of_its_subtree():
    tree = compiled('<SubTree ID="B" v="0.5"/>', B='<Fixed speed="{v}"/>')
    assert [node.speed for node in tree.root.iterate() if isinstance(node, Fixed)] == [0.5]


def test_an_attribute_that_is_fixed_cannot_take_what_is_written_later():
    with pytest.raises(TreeError) as caught:
        compiled(
            '<Sequence><SubTree ID="B" name="1"/><SubTree ID="B" name="2"/></Sequence>',
            {"w": 1},
            B='<Fixed speed="{v}"/>',
        )
    (finding,) = caught.value.findings
    assert (finding.code, finding.span.line) == ("unknown-key", 3)
    assert "{@v}" in (finding.hint or "")


def test_findings_of_the_compiler_come_in_the_order_of_the_file():
    with pytest.raises(TreeError) as caught:
        compiled(
            '<Sequence><SubTree ID="B"/><Fixed speed="{b}"/><Fixed speed="{a}"/></Sequence>',
            B='<Fixed speed="{@c}"/>',
        )
    places = [(finding.span.line, finding.span.column) for finding in caught.value.findings]
    assert len(places) == 3
    assert places == sorted(places)


def test_two_compiled_trees_share_no_keys():
    first, second = (compiled('<Script code="x := @start + 1"/>', {"start": start}) for start in (1, 5))
    first.root.tick_once()
    second.root.tick_once()
    assert (own(first)["x"], own(second)["x"]) == (2, 6)


def test_the_keys_of_a_tree_are_forgotten_with_it():
    gc.collect()  # of the trees of other tests
    before = set(Blackboard.storage)
    tree = compiled('<SubTree ID="B"/>', {"a": 1}, B='<Script code="x := 1"/>')
    tree.root.tick_once()
    assert set(Blackboard.storage) > before
    del tree
    gc.collect()
    assert set(Blackboard.storage) <= before


KEYS = st.sampled_from(["a", "b", "c", "_p", "@a"])
PASSED = st.dictionaries(
    st.sampled_from(["a", "b", "c"]),
    KEYS.map(lambda key: f"{{{key}}}") | st.sampled_from(["{=}", "7"]),
    max_size=3,
)


@given(st.lists(st.tuples(PASSED, st.booleans()), min_size=1, max_size=4), KEYS)
def test_a_key_means_what_following_the_trees_from_the_inside_out_says(levels, key):
    """The rules of a SubTree, followed by hand, and what the compiled tree does."""
    trees = {f"T{number}": _subtree(number + 1, *level) for number, level in enumerate(levels) if number}
    tree = compiled(_subtree(1, *levels[0]), **trees, **{f"T{len(levels)}": f'<Script code="{key} := 1"/>'})
    tree.root.tick_once()
    depth, owned = _owner(levels, key)
    assert own(tree).get(owned) == (1 if depth == 0 else None)


def _subtree(number, passed, autoremap):
    attributes = " ".join(f'{key}="{value}"' for key, value in passed.items())
    return f'<SubTree ID="T{number}" {attributes} _autoremap="{str(autoremap).lower()}"/>'


def _owner(levels, key):
    depth = len(levels)
    while depth and not key.startswith("@"):
        passed, autoremap = levels[depth - 1]
        written = passed.get(key)
        if written == "7" or (written is None and (not autoremap or key.startswith("_"))):
            return depth, key
        key = key if written in (None, "{=}") else written[1:-1]
        depth -= 1
    return 0, key.removeprefix("@")
