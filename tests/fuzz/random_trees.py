"""Random trees: every tag, valid and invalid attributes and values, subtrees, conditions."""

from xml.sax.saxutils import quoteattr

from hypothesis import strategies as st

from sar_compiler.nodes.binding.attributes import CONDITIONS, NOTES
from sar_compiler.nodes.registry import default_registry
from sar_compiler.nodes.spec import Kind, NodeSpec, Parameter
from sar_compiler.nodes.values import NO_VALUE

REGISTRY = default_registry()
SPECS = list(REGISTRY)
LEAVES = [spec for spec in SPECS if spec.kind.is_leaf]
PARENTS = [spec for spec in SPECS if not spec.kind.is_leaf]
TREES = ["Main", "B", "C"]

KEYS = st.sampled_from(["{a}", "{b}", "{@c}", "{_p}", "{=}"])
SCRIPTS = st.sampled_from(
    ["a := 1", "b == 'x'", "true", "1; 2", "a := b ? c : 1", "a +", "(", "x y z", "'", "@a > 0"]
)
TEXTS = st.sampled_from(
    ["0", "1", "-1", "2.5", "true", "SUCCESS", "1;2", "a", "Sequence", "", "{", "json:[1]", "json:", "5s"]
)
VALUES = (
    KEYS | SCRIPTS | TEXTS | st.text(st.characters(min_codepoint=32, exclude_categories=["Cs"]), max_size=6)
)


def _values_of(parameter: Parameter):
    """Return a strategy for values of a parameter, most of them valid."""
    value_type = parameter.value_type
    if value_type is NO_VALUE or value_type.python is None:
        return VALUES
    if value_type.choices:
        return st.sampled_from(value_type.choices) | VALUES
    right = {int: "3", float: "1.5"}.get(value_type.python, "1")
    return st.just(right) | st.just(right) | VALUES


@st.composite
def _attributes(draw, spec: NodeSpec):
    written = {
        parameter.name: draw(_values_of(parameter))
        for parameter in spec.attributes
        if draw(st.integers(0, 9)) < (9 if parameter.required else 2)
    }
    if draw(st.integers(0, 4)) == 0:
        name = draw(st.sampled_from([*CONDITIONS, *NOTES, "oneshot", "memory", "nmae", "ID", "x"]))
        written[name] = draw(SCRIPTS | TEXTS | st.sampled_from(["ON_COMPLETION", "true"]))
    return written


def _element(tag: str, attributes: dict[str, str], children: tuple[str, ...] = ()) -> str:
    written = "".join(f" {name}={quoteattr(value)}" for name, value in attributes.items())
    return f"<{tag}{written}>{''.join(children)}</{tag}>\n" if children else f"<{tag}{written}/>\n"


@st.composite
def _leaf(draw):
    if draw(st.integers(0, 4)) == 0:
        passed = draw(
            st.dictionaries(st.sampled_from(["a", "b", "_autoremap", "name", "_skipIf"]), VALUES, max_size=2)
        )
        return _element("SubTree", {"ID": draw(st.sampled_from([*TREES, "D"])), **passed})
    spec = draw(st.sampled_from(LEAVES))
    return _element(spec.tag, draw(_attributes(spec)))


@st.composite
def _parent(draw, children):
    spec = draw(st.sampled_from(PARENTS))
    attributes = draw(_attributes(spec))
    least, most = spec.child_count
    count = (
        draw(st.integers(least, most or least + 2)) if draw(st.integers(0, 9)) else draw(st.integers(0, 3))
    )
    inner = tuple(draw(children) for _ in range(count))
    if "ID" not in attributes and draw(st.integers(0, 9)) == 0:
        kind = draw(st.sampled_from([kind.value for kind in Kind]) | st.just(spec.kind.value))
        return _element(kind, {"ID": spec.tag, **attributes}, inner)
    return _element(spec.tag, attributes, inner)


NODES = st.recursive(_leaf(), _parent, max_leaves=8)
"""The text of a node with its children."""


@st.composite
def tree_texts(draw):
    """The text of a file with some trees."""
    trees = "".join(
        _element("BehaviorTree", {"ID": name}, (draw(NODES),)) for name in TREES[: draw(st.integers(1, 3))]
    )
    return f'<root BTCPP_format="4" main_tree_to_execute="Main">\n{trees}</root>\n'


UNKNOWN = ["TestA", "Sucess", "Drive", "Navigate", "BehaviorTree", "TreeNodesModel", "include", "root"]
_TAGS = [*(spec.tag for spec in SPECS), *(kind.value for kind in Kind), "SubTree", *UNKNOWN]


@st.composite
def _any_element(draw, children=None, most=0):
    """An element of any tag, known or not, with any attributes and up to *most* children."""
    tag = draw(st.sampled_from(_TAGS))
    specs = list(REGISTRY.variants(tag))
    fitting = draw(_attributes(specs[0])) if specs and draw(st.booleans()) else {}
    names = st.sampled_from(["ID", "name", "nmae", "success_count", "if", "port", *CONDITIONS])
    others = draw(st.dictionaries(names, VALUES | st.sampled_from(_TAGS), max_size=2))
    inner = draw(st.lists(children, max_size=most)) if children is not None else ()
    return _element(tag, {**fitting, **others}, tuple(inner))


WRONG_NODES = st.recursive(
    _any_element(), lambda inner: _any_element(inner, 4) | _parent(inner), max_leaves=10
)
"""The text of a node in which any tag may have any children, also too few or unknown ones."""
MODELS = st.sampled_from(
    [
        "",
        '<TreeNodesModel><Action ID="Drive"><input_port name="gear"/><output_port name="a"/></Action></TreeNodesModel>',
        '<TreeNodesModel><Control ID="TestA"/><Decorator ID="Navigate"/><SubTree ID="B"/></TreeNodesModel>',
        '<TreeNodesModel><Action/><Condition ID="Sequence"/><input_port name="x"/></TreeNodesModel>',
    ]
)


@st.composite
def wrong_tree_texts(draw):
    """The text of a well-formed file in which anything else may be wrong."""
    trees = [
        _element(
            "BehaviorTree",
            {"ID": draw(st.sampled_from(TREES))},
            tuple(draw(st.lists(WRONG_NODES, max_size=2))),
        )
        for _ in range(draw(st.integers(1, 3)))
    ]
    return f'<root BTCPP_format="4">\n{"".join(trees)}{draw(MODELS)}</root>\n'
