"""Tests of the types of keys that subtrees share: they must be the same as with all subtrees inlined."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from py_trees.behaviour import Behaviour
from py_trees.common import Status

from sar_compiler.compiler import bind_main, compile_tree
from sar_compiler.nodes.binding.binder import bind
from sar_compiler.nodes.registry import Registry, default_registry
from sar_compiler.nodes.spec import Kind, NodeSpec
from sar_compiler.runtime.ports import Input
from tests.random_inputs import rounds
from tests.trees import errors, forest_of


class Read(Behaviour):
    def __init__(
        self,
        name: str,
        number: Input[float] | None = None,
        count: Input[int] | None = None,
        text: Input[str] | None = None,
        flag: Input[bool] | None = None,
        thing: Input[object] | None = None,
    ) -> None:
        super().__init__(name)
        self.ports = (number, count, text, flag, thing)

    def update(self) -> Status:
        return Status.SUCCESS


REGISTRY = Registry([*default_registry().specs(), NodeSpec("Read", Read, Kind.ACTION)])
KEYS = st.sampled_from(["a", "b", "_c"])
ROOT_KEY = KEYS.map(lambda key: f"@{key}")
READ = st.tuples(
    st.just("read"), st.sampled_from(["number", "count", "text", "flag", "thing"]), KEYS | ROOT_KEY
)
WRITE = st.tuples(st.just("write"), KEYS | ROOT_KEY)
REMAPPED = st.dictionaries(st.sampled_from(["a", "b"]), KEYS | ROOT_KEY, max_size=2)


def subtree(number):
    """Return a strategy for uses of later trees, so that no tree contains itself."""
    return st.tuples(st.just("use"), st.integers(number + 1, 2), REMAPPED, st.booleans())


TREES = st.tuples(
    *(
        st.lists(READ | READ | WRITE | (subtree(number) if number < 2 else READ), min_size=1, max_size=4)
        for number in range(3)
    )
)


def element(item):
    if item[0] == "read":
        return f'<Read {item[1]}="{{{item[2]}}}"/>'
    if item[0] == "write":
        return f"<Script code=\"{item[1]} := '1'\"/>"
    _, number, remapped, autoremap = item
    ports = "".join(f' {key}="{{{outer}}}"' for key, outer in remapped.items())
    return f'<SubTree ID="T{number}" _autoremap="{str(autoremap).lower()}"{ports}/>'


def write_trees(trees):
    """Return the text of a file with the trees, one node a line, and the line of each node."""
    lines = ['<root BTCPP_format="4" main_tree_to_execute="T0">']
    places = {}
    for number, items in enumerate(trees):
        lines.append(f'<BehaviorTree ID="T{number}"><Sequence>')
        for index, item in enumerate(items):
            lines.append(element(item))
            places[number, index] = len(lines)
        lines.append("</Sequence></BehaviorTree>")
    return "\n".join([*lines, "</root>"]), places


def inline_subtrees(trees):
    """Return the nodes of the main tree with its subtrees inlined, each with its tree and index."""
    nodes, count = [], 0

    def walk(number, meaning):
        nonlocal count
        for index, item in enumerate(trees[number]):
            if item[0] != "use":
                *what, key = item
                nodes.append(((*what, meaning(key)), (number, index)))
                continue
            count += 1
            _, inner, remapped, autoremap = item

            def within(key, own=f"own{count}", remapped=remapped, autoremap=autoremap):
                if key.startswith("@"):
                    return key[1:]
                if key in remapped:
                    return meaning(remapped[key])
                return meaning(key) if autoremap and not key.startswith("_") else f"{own}{key}"

            walk(inner, within)

    walk(0, lambda key: key.removeprefix("@"))
    return nodes


def lines_of(text):
    file = forest_of(text)
    found = bind(file, REGISTRY, file.trees["T0"]).findings
    assert {finding.code for finding in found} <= {"key-of-two-types"}
    return {finding.span.line for finding in found}


def values_after_a_tick(text):
    tree = compile_tree(bind_main(forest_of(text), REGISTRY), {}, {})
    tree.root.tick_once()
    assert tree.root.status is Status.SUCCESS, tree.root.feedback_message
    return sorted(repr(tree.board.get(name)) for name in tree.board.names())


def as_main_tree(items):
    text, places = write_trees([items])
    return text, {line: index for (_, index), line in places.items()}


@settings(max_examples=rounds(75))
@given(TREES)
def test_key_types_are_those_of_tree_with_inlined_subtrees(trees):
    text, places = write_trees(trees)
    nodes = inline_subtrees(trees)
    flattened, index_of = as_main_tree([item for item, _ in nodes])
    expected = {places[nodes[index_of[line]][1]] for line in lines_of(flattened)}
    assert lines_of(text) == expected
    if not expected:
        assert values_after_a_tick(text) == values_after_a_tick(flattened)


@pytest.mark.parametrize(
    ("first", "second"), [("_autoremap='true'", "_autoremap='true'"), ("c='{=}'", "_autoremap='true'")]
)
def test_types_of_key_shared_by_two_subtrees_are_compared_in_tree_order(first, second):
    def codes_and_lines(*inner):
        text = (
            f'<root BTCPP_format="4" main_tree_to_execute="M"><BehaviorTree ID="M"><Sequence><SubTree ID="A" {first}/>'
            f'<Read text="{{c}}"/><SubTree ID="B" {second}/></Sequence></BehaviorTree>\n'
            + "\n".join(
                f'<BehaviorTree ID="{name}">{body}</BehaviorTree>'
                for name, body in zip("AB", inner, strict=True)
            )
            + "</root>"
        )
        return [(finding.code, finding.span.line) for finding in errors(forest_of(text), REGISTRY)]

    flag, thing = '<Read flag="{c}"/>', '<Read thing="{c}"/>'
    assert codes_and_lines(flag, thing) == [("key-of-two-types", 1)]
    assert codes_and_lines(thing, flag) == []
