"""Tests of blackboard keys in subtrees: which entry a key refers to."""

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


def compile_trees(main, parameters=None, **trees):
    others = "".join(f'<BehaviorTree ID="{name}">{body}</BehaviorTree>\n' for name, body in trees.items())
    text = (
        f'<root main_tree_to_execute="Main">\n<BehaviorTree ID="Main">{main}</BehaviorTree>\n{others}</root>'
    )
    return compile_tree(bind_main(forest_of(text), REGISTRY), {}, parameters or {})


def keys_after_tick(main, parameters=None, **trees):
    """Return the keys of the main tree and their values after one tick."""
    tree = compile_trees(main, parameters, **trees)
    tree.root.tick_once()
    return main_tree_keys(tree)


def main_tree_keys(tree):
    prefix = f"{tree.board.prefix}/"
    names = [name.removeprefix(prefix) for name in tree.board.names()]
    return {name: tree.board.get(prefix + name) for name in names if "/" not in name}


def test_subtree_key_is_local():
    assert keys_after_tick('<SubTree ID="B"/>', B='<Script code="x := 1"/>') == {}


def test_remapped_key_is_that_of_calling_tree():
    assert keys_after_tick('<SubTree ID="B" x="{y}"/>', B='<Script code="x := 1"/>') == {"y": 1}


def test_key_can_be_remapped_to_its_own_name():
    assert keys_after_tick('<SubTree ID="B" x="{=}"/>', B='<Script code="x := 1"/>') == {"x": 1}


def test_key_is_remapped_through_intermediate_trees():
    inner = {"B": '<SubTree ID="C" z="{x}"/>', "C": '<Script code="z := 1"/>'}
    assert keys_after_tick('<SubTree ID="B" x="{y}"/>', **inner) == {"y": 1}


def test_local_key_of_intermediate_tree_stays_local():
    inner = {"B": '<SubTree ID="C" z="{kept}"/>', "C": '<Script code="z := 1"/>'}
    assert keys_after_tick('<SubTree ID="B" x="{y}"/>', **inner) == {}


def test_autoremap_remaps_all_but_private_keys():
    assert keys_after_tick('<SubTree ID="B" _autoremap="true"/>', B='<Script code="x := 1; _y := 2"/>') == {
        "x": 1
    }


def test_explicit_remapping_overrides_autoremap():
    assert keys_after_tick(
        '<SubTree ID="B" x="{z}" _autoremap="true"/>', B='<Script code="x := 1; y := 2"/>'
    ) == {
        "z": 1,
        "y": 2,
    }


def test_constant_is_local_to_subtree_despite_autoremap():
    assert keys_after_tick(
        '<Sequence><Script code="x := 5"/><SubTree ID="B" x="7" _autoremap="true"/></Sequence>',
        B='<Script code="seen := x; x := 8"/>',
    ) == {"x": 5, "seen": 7}


def test_slashes_in_names_do_not_merge_subtrees():
    tree = compile_trees(
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
def test_reference_out_of_subtree_to_its_parent_is_reported(levels):
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


def test_string_port_reads_constant_as_written():
    body = '<Switch2 variable="{zone}" case_1="7" case_2="8"><Failure/><Success/><Failure/></Switch2>'
    tree = compile_trees('<SubTree ID="B"/>', B='<SubTree ID="C" zone="007" count="007"/>', C=body)
    (outer,) = tree.instance.inner.values()
    (inner,) = outer.inner.values()
    assert [inner.scope.resolve(key).read() for key in ("zone", "count")] == ["007", 7]


@pytest.mark.parametrize("name", ["b", "b::1"])
def test_subtrees_of_same_name_have_separate_keys(name):
    main = f'<Sequence><SubTree ID="B" name="{name}" x="1"/><SubTree ID="B" name="{name}" x="2"/></Sequence>'
    tree = compile_trees(main, B='<Script code="y := x"/>')
    tree.root.tick_once()
    assert [inner.scope.resolve("y").read() for inner in tree.instance.inner.values()] == [1, 2]


def test_single_equals_sign_is_string_for_subtree():
    assert keys_after_tick('<SubTree ID="B" x="=" y="{=}"/>', B='<Script code="y := x"/>') == {"y": "="}


def test_remapped_entry_port_names_key_of_calling_tree():
    tree = '<Sequence><Script code="n = 1"/><SubTree ID="B" m="{n}"/></Sequence>'
    assert keys_after_tick(tree, B='<WasEntryUpdated entry="{m}"/>') == {"n": 1}


@pytest.mark.parametrize(
    ("text", "value"),
    [("7", 7), ("1e3", 1000.0), ("+7", "+7"), ("-inf", -math.inf), ("true", "true"), ("a b", "a b")],
)
def test_constant_has_type_of_its_literal(text, value):
    seen = keys_after_tick(f'<SubTree ID="B" x="{text}"/>', B='<Script code="@seen := x"/>')["seen"]
    assert seen == value


def test_at_sign_refers_to_root_key_in_any_tree():
    inner = {"B": '<SubTree ID="C"/>', "C": '<Script code="@x := 1"/>'}
    assert keys_after_tick('<SubTree ID="B"/>', **inner) == {"x": 1}


def test_root_key_can_be_remapped():
    inner = {"B": '<SubTree ID="C" z="{@far}"/>', "C": '<Script code="z := 1"/>'}
    assert keys_after_tick('<SubTree ID="B"/>', **inner) == {"far": 1}


def test_instances_of_same_tree_have_separate_keys():
    tree = compile_trees(
        '<Sequence><SubTree ID="B" name="a" me="1"/><SubTree ID="B" name="b" me="2"/></Sequence>',
        B='<Script code="kept := me"/>',
    )
    tree.root.tick_once()
    assert [inner.scope.resolve("kept").read() for inner in tree.instance.inner.values()] == [1, 2]


def test_mission_parameters_are_root_keys():
    tree = compile_trees('<SubTree ID="B" v="{speed}"/>', {"speed": 2, "goal": "x"}, B='<Fixed speed="{v}"/>')
    assert main_tree_keys(tree) == {"speed": 2, "goal": "x"}
    assert [node.speed for node in tree.root.iterate() if isinstance(node, Fixed)] == [2.0]


def test_fixed_attribute_accepts_constant_of_its_subtree():
    tree = compile_trees('<SubTree ID="B" v="0.5"/>', B='<Fixed speed="{v}"/>')
    assert [node.speed for node in tree.root.iterate() if isinstance(node, Fixed)] == [0.5]


def test_fixed_attribute_rejects_key_written_at_run_time():
    with pytest.raises(TreeError) as caught:
        compile_trees(
            '<Sequence><SubTree ID="B" name="1"/><SubTree ID="B" name="2"/></Sequence>',
            {"w": 1},
            B='<Fixed speed="{v}"/>',
        )
    (finding,) = caught.value.findings
    assert (finding.code, finding.span.line) == ("unknown-key", 3)
    assert "{@v}" in (finding.hint or "")


def test_compiler_findings_are_in_file_order():
    with pytest.raises(TreeError) as caught:
        compile_trees(
            '<Sequence><SubTree ID="B"/><Fixed speed="{b}"/><Fixed speed="{a}"/></Sequence>',
            B='<Fixed speed="{@c}"/>',
        )
    places = [(finding.span.line, finding.span.column) for finding in caught.value.findings]
    assert len(places) == 3
    assert places == sorted(places)


def test_compiled_trees_share_no_keys():
    first, second = (compile_trees('<Script code="x := @start + 1"/>', {"start": start}) for start in (1, 5))
    first.root.tick_once()
    second.root.tick_once()
    assert (main_tree_keys(first)["x"], main_tree_keys(second)["x"]) == (2, 6)


def test_keys_of_deleted_tree_are_removed():
    gc.collect()  # of the trees of other tests
    before = set(Blackboard.storage)
    tree = compile_trees('<SubTree ID="B"/>', {"a": 1}, B='<Script code="x := 1"/>')
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
def test_key_resolution_matches_subtree_rules(levels, key):
    """Compare the compiled tree with the rules of a SubTree, applied from the inside out."""
    trees = {f"T{number}": _subtree(number + 1, *level) for number, level in enumerate(levels) if number}
    tree = compile_trees(
        _subtree(1, *levels[0]), **trees, **{f"T{len(levels)}": f'<Script code="{key} := 1"/>'}
    )
    tree.root.tick_once()
    depth, owned = _owner(levels, key)
    assert main_tree_keys(tree).get(owned) == (1 if depth == 0 else None)


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
