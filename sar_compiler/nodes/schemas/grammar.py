"""The grammar of tree files in YAML, made from the registry, for programs that let a language model write nothing else.

It is in the form of Lark that llguidance reads, with parameters: the parameter of a rule has in its lowest bits how deep a node
stands, and above them a bit for each attribute that was written. What can be written is the form that `convert` and `format`
write, with comments; without explicit forms, models, texts of several lines, and nodes deeper than `LEVELS`.
"""

import json
from collections.abc import Iterable, Iterator, Mapping, Sequence

from sar_compiler.nodes.binding.attributes import CONDITIONS, ONESHOT, ONESHOT_TYPE
from sar_compiler.nodes.registry import Registry
from sar_compiler.nodes.schemas import attributes_by_name, required_names, value_types
from sar_compiler.nodes.spec import NodeSpec, Parameter, Role
from sar_compiler.nodes.values import ValueType
from sar_compiler.runtime.expressions import Script
from sar_compiler.tree.model import CHILDREN_KEY, INCLUDE_TAG, ROOT_TAG, SUBTREE_TAG, TREE_TAG
from sar_compiler.tree.yaml_writer import scalar

LEVELS = 48
"""How deep nodes may stand in each other."""
_DEPTH_BITS = 6
_DEPTH = f"[0:{_DEPTH_BITS}]"
_COLUMNS = 6
"""How much deeper a node stands than the one that it is in."""
_BREAK = r"( +#[^\n]*)?(\n *(#[^\n]*)?)*\n"
"""The end of a line, with the comment behind it, and lines without content."""
_ODD = r"\x00-\x1f\x7f-\x9f\u{2028}\u{2029}\u{feff}\u{fffe}\u{ffff}"
"""Characters that YAML does not have, or takes for the end of a line."""
_WORD = rf"([^ #{_ODD}][^ {_ODD}]*)?[^ :{_ODD}]"
_FIRST_WORD = rf"([A-Za-z0-9_\/($.+]|-[A-Za-z0-9.]|[^\x00-\x9f{_ODD}])([^ {_ODD}]*[^ :{_ODD}])?"
_FRAME = rf"""// Made from the node registry by `sar-compile schema --format grammar`.
start: HEAD? "{ROOT_TAG}:" (IN_ROOT root_attribute)* IN_ROOT "{CHILDREN_KEY}:" section+ END
root_attribute: "BTCPP_format: 4" | "main_tree_to_execute: " TEXT | "project_name: " TEXT
section: SECTION "{TREE_TAG}:" (IN_SECTION "ID: " TEXT)? IN_SECTION "{CHILDREN_KEY}:" node::0
       | SECTION "{INCLUDE_TAG}:" ros_pkg? IN_SECTION "path: " TEXT ros_pkg?
ros_pkg: IN_SECTION "ros_pkg: " TEXT
HEAD: /( *(#[^\n]*)?\n)+/
END: /( +#[^\n]*)?(\n *(#[^\n]*)?)*/
IN_ROOT: /{_BREAK} {{2}}/
SECTION: /{_BREAK} {{4}}- /
IN_SECTION: /{_BREAK} {{8}}/
TEXT: PLAIN | SINGLE | DOUBLE
PLAIN: /{_FIRST_WORD}( +{_WORD})*( +#[^\n]*)?/
SINGLE: /'([^'{_ODD}]|'')*'/
DOUBLE: /"([^"\\{_ODD}]|\\["\\ntr])*"/
KEY: /'(\{{[^'{{}}{_ODD}]+\}}|=)'|"\{{[^"\\{{}}{_ODD}]+\}}"/
PORT: /[A-Za-z_][A-Za-z0-9_.\-]*: /
ports::_ : ""
  | ports::_ line::_ PORT TEXT
more::_ : ""
  | more::_ node::_"""


def grammar(registry: Registry) -> str:
    """Return the grammar of the YAML files that may be written with a registry."""
    tags = registry.by_tag()
    types = {each: f"VALUE{number}" for number, each in enumerate(value_types(tags)) if _has_pattern(each)}
    ways = [way for number, (tag, specs) in enumerate(tags.items()) for way in _node(number, tag, specs)]
    rules = [
        _FRAME,
        _rule("node", [f'dash::_ "{SUBTREE_TAG}:" ports::_ line::_ "ID: " TEXT ports::_', *ways]),
        *(
            _rule(f"in{number}", _content(f"in{number}", specs, types))
            for number, specs in enumerate(tags.values())
        ),
        *(f"{name}: {_terminal(each.pattern)}" for each, name in types.items()),
        *_breaks("dash", 10, "- "),
        *_breaks("line", 14, ""),
    ]
    return "\n".join([*rules, ""])


def _rule(name: str, ways: Iterable[str]) -> str:
    return f"{name}::_ : " + "\n  | ".join(ways)


def _breaks(name: str, column: int, end: str) -> Iterator[str]:
    """Yield the rules of what begins a line of each depth, from the column of the first one on."""
    terminals = [f"{name.upper()}{level}" for level in range(LEVELS)]
    yield _rule(name, (f"{each} %if eq({_DEPTH}, {level})" for level, each in enumerate(terminals)))
    for level, terminal in enumerate(terminals):
        yield f"{terminal}: /{_BREAK} {{{column + _COLUMNS * level}}}{end}/"


def _node(number: int, tag: str, specs: Sequence[NodeSpec]) -> Iterator[str]:
    """Yield the ways in which a node is written: by its tag alone, and with what is in it."""
    if specs[0].kind.is_leaf and not required_names(specs):
        yield f"dash::_ {json.dumps(scalar(tag))}"
    yield f"dash::_ {json.dumps(f'{scalar(tag)}:')} in{number}::bit_and({(1 << _DEPTH_BITS) - 1})"


def _content(rule: str, specs: Sequence[NodeSpec], types: Mapping[ValueType, str]) -> Iterator[str]:
    """Yield how what is in a node goes on: with each attribute once, or with its end, when all is written that must be."""
    written = {name: _value(*choices[0], types) for name, choices in attributes_by_name(specs).items()}
    written |= {ONESHOT: _one_of(ONESHOT_TYPE.choices), **dict.fromkeys(CONDITIONS, "TEXT")}
    bits = {name: bit for bit, name in enumerate(written, _DEPTH_BITS)}
    for name, value in written.items():
        once = f"{rule}::set_bit({bits[name]}) %if bit_clear({bits[name]})"
        yield f"line::_ {json.dumps(f'{scalar(name)}: ')} {value} {once}"
    is_complete = "true"
    for name in required_names(specs):
        is_complete = f"and(bit_set({bits[name]}), {is_complete})"
    for end in _ends(*specs[0].child_count):
        yield f"{end} %if {is_complete}"


def _ends(least: int, most: int | None) -> Iterator[str]:
    """Yield how a node ends: with so many nodes in it, or with nothing."""
    below = f"node::incr({_DEPTH})"
    if most == 0:
        yield '""'
    for count in [least] if most is None else range(max(least, 1), most + 1):
        more = "" if most is not None else f" more::incr({_DEPTH})"
        yield f'line::_ "{CHILDREN_KEY}:" {" ".join([below] * count)}{more}'


def _value(spec: NodeSpec, parameter: Parameter, types: Mapping[ValueType, str]) -> str:
    """Return what an attribute may have as its value."""
    value_type = parameter.value_type
    if parameter.role is not Role.ATTRIBUTE:
        return "TEXT"
    if parameter.name in spec.fixed:
        return _one_of(spec.texts_of_fixed(parameter))
    if value_type.choices:
        return f"({_one_of(value_type.choices)} | KEY)"
    return f"({types[value_type]} | KEY)" if value_type in types else "TEXT"


def _one_of(texts: Iterable[str]) -> str:
    return f"({' | '.join(json.dumps(scalar(text)) for text in texts)})"


def _has_pattern(value_type: ValueType) -> bool:
    return bool(value_type.pattern) and not value_type.choices and value_type.python is not Script


def _terminal(pattern: str) -> str:
    """Return the terminal of a text with a pattern, with and without quotation marks."""
    return " | ".join(f"/{quote}({pattern}){quote}/" for quote in ("", "'", '"'))
