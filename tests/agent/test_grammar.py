"""The grammar of trees in YAML, read by llguidance: what it lets a model write, and what it does not."""

import random
from pathlib import Path

import pytest
from llguidance import LLMatcher, LLTokenizer

from benchmarks.mending import slip
from sar_compiler.nodes.binding.attributes import CONDITIONS, ONESHOT, ONESHOT_TYPE
from sar_compiler.nodes.registry import Registry, default_registry
from sar_compiler.nodes.schemas import attributes_by_name, required_names
from sar_compiler.nodes.schemas.grammar import LEVELS, grammar
from sar_compiler.tree.conversion import convert
from sar_compiler.tree.diagnostic import Form
from sar_compiler.tree.gathering import read_tree_file
from sar_compiler.tree.xml import parse_xml
from sar_compiler.tree.yaml import parse_yaml
from sar_compiler.tree.yaml_writer import scalar
from tests.checks.test_mistakes import CORRECT
from tests.cli.running import run
from tests.nodes import leaves
from tests.trees import document

WRONG = 500
TAGS = default_registry().by_tag()
BYTES = LLTokenizer("byte")
COMMON = {ONESHOT, *CONDITIONS}


def matcher(registry):
    made = LLMatcher(BYTES, LLMatcher.grammar_from_lark(grammar(registry)))
    assert made.get_error() == ""
    return made


ANY_TREE = matcher(default_registry())


def can_be_written(text, start=ANY_TREE):
    """Return whether a model that writes by the grammar can write a text, and end there."""
    writing = start.deep_copy()
    tokens = BYTES.tokenize_str(text)
    return writing.try_consume_tokens(tokens) == len(tokens) and writing.is_accepting()


def node(tag, attributes, children):
    """Return the lines of a node in a tree; its attributes are written as they are given."""
    inside = [f"    {name}: {value}" for name, value in attributes.items()]
    if children:
        inside += ["    children:", *["      - AlwaysSuccess"] * children]
    return [f"- {tag}{':' if inside else ''}", *inside]


def tree(lines):
    """Return a file with one tree."""
    head = [
        "root:",
        "  BTCPP_format: 4",
        "  children:",
        "    - BehaviorTree:",
        "        ID: Main",
        "        children:",
    ]
    return "\n".join([*head, *(f"          {line}" for line in lines)]) + "\n"


def value_of(spec, parameter):
    value_type = parameter.value_type
    if parameter.name in spec.fixed:
        return next(t for t in value_type.choices if value_type.convert(t) == spec.fixed[parameter.name])
    return scalar(value_type.example if value_type else "x")


def sample(chance):
    """Return a node that is right: its tag, its attributes, how many nodes it has, and which choices each attribute has."""
    tag = chance.choice(sorted(TAGS))
    specs = TAGS[tag]
    written = {name: choices[0] for name, choices in attributes_by_name(specs).items()}
    chosen = {name for name in written if name in required_names(specs) or chance.random() < 0.5}
    attributes = {name: value_of(*written[name]) for name in written if name in chosen}
    choices = {name: written[name][1].value_type.choices for name in chosen if written[name][1].value_type}
    if chance.random() < 0.3:
        attributes[ONESHOT], choices[ONESHOT] = chance.choice(ONESHOT_TYPE.choices), ONESHOT_TYPE.choices
    return tag, attributes, specs[0].child_count[0], choices


def wrong_node(chance, what):
    """Return a right node, and the same with a tag, an attribute or a value of an enumeration that there is not; None if it has none."""
    tag, attributes, children, choices = sample(chance)
    right = node(tag, attributes, children)
    if what == "tag":
        other = slip(chance, tag)
        return None if other in TAGS or not other else (right, node(other, attributes, children))
    listed = [name for name in attributes if what == "attribute" or choices.get(name)]
    if not listed:
        return None
    name = chance.choice(listed)
    if what == "attribute":
        other = slip(chance, name)
        if other in {*attributes_by_name(TAGS[tag]), *COMMON, ""}:
            return None
        renamed = {other if each == name else each: value for each, value in attributes.items()}
        return right, node(tag, renamed, children)
    other = slip(chance, attributes[name])
    return None if other in choices[name] else (right, node(tag, {**attributes, name: other}, children))


def wrong_nodes():
    chance = random.Random(30)  # noqa: S311 - the same nodes in every run
    found: list[tuple[list[str], list[str]]] = []
    while len(found) < WRONG:
        what = ("tag", "attribute", "enumeration")[len(found) % 3]
        found += [each for each in [wrong_node(chance, what)] if each is not None]
    return found


def test_no_wrong_tag_attribute_or_enumeration_can_be_written_and_the_right_one_can():
    pairs = wrong_nodes()
    assert [right for right, _ in pairs if not can_be_written(tree(right))] == []
    assert [wrong for _, wrong in pairs if can_be_written(tree(wrong))] == []


@pytest.mark.parametrize("path", sorted(Path("trees").glob("*.xml")), ids=str)
def test_every_shipped_tree_can_be_written(path):
    assert can_be_written(convert(read_tree_file(path), Form.YAML).text)


@pytest.mark.parametrize("name", sorted(CORRECT))
def test_what_is_correct_can_be_written(name):
    assert can_be_written(convert(parse_xml(document(CORRECT[name])), Form.YAML).text)


@pytest.mark.parametrize(
    ("lines", "can"),
    [
        (["- Delay:", "    delay_msec: 5", "    children:", "      - Success"], True),
        (["- Delay:", "    children:", "      - Success"], False),
        (["- Delay:", "    delay_msec: 5", "    delay_msec: 6", "    children:", "      - Success"], False),
        (["- Delay:", "    delay_msec: soon", "    children:", "      - Success"], False),
        (["- Delay:", "    delay_msec: '{soon}'", "    children:", "      - Success"], True),
        (["- Delay:", "    delay_msec: '5ms'", "    children:", "      - Success"], True),
        (["- Delay:", "    delay_msec: 5"], False),
        (["- Inverter:", "    children:", "      - Success", "      - Success"], False),
        (["- Success:", "    children:", "      - Success"], False),
        (["- Success", "- Success"], False),
        (["- Sequence:", "    children:", "      - Success", "    name: late"], False),
        (["- Sequence:", "    children:", "    - Success"], False),
        (["- SubTree:", "    goal: '{goal}'", "    ID: Other", "    _autoremap: true"], True),
        (["- SubTree:", "    goal: '{goal}'"], False),
        (["- Success:  # why", "    # more", "", "    name: done  # so"], True),
    ],
    ids=str,
)  # fmt: skip
def test_of_the_content_of_a_node_can_be_written(lines, can):
    assert can_be_written(tree(lines)) == can


TEXTS = ["a b", "a: b", "a #b", "#a", "5", "-0.5", "- a", "", "it's", 'say "x"', "tab\t", "x := 1; y = 'z'", "(a)",
         "{a}", "true", "no", "ä ö", "a:", ":a", "[1]", "*x", "&x", "!x", "%x", "@x", "`x", "?", "-", "~"]  # fmt: skip


@pytest.mark.parametrize("text", TEXTS)
def test_every_text_of_a_line_can_be_written_as_it_is_converted(text):
    written = tree(node("Success", {"name": scalar(text)}, 0))
    assert parse_yaml(written).trees[0].children[0].attributes["name"] == text
    assert can_be_written(written)


def test_nodes_stand_in_each_other_as_deep_as_it_says():
    def nested(levels):
        body = "<Inverter>" * (levels - 1) + "<Success/>" + "</Inverter>" * (levels - 1)
        return convert(parse_xml(document(body)), Form.YAML).text

    assert can_be_written(nested(LEVELS))
    assert not can_be_written(nested(LEVELS + 1))


def test_leaves_of_a_user_are_in_the_grammar_of_their_registry():
    registry = Registry()
    registry.add_module(leaves)
    start = matcher(registry)
    assert can_be_written(tree(["- Say:", "    message: hi"]), start)
    assert not can_be_written(tree(["- Sey:", "    message: hi"]), start)
    assert not can_be_written(tree(["- ZonesRemaining"]), start)


def test_an_include_can_be_written():
    lines = ["root:", "  children:", "    - include:", "        path: other.yaml", "        ros_pkg: robot"]
    assert can_be_written("\n".join(lines))


def test_the_command_prints_it(capsys):
    status, said, _ = run(capsys, "schema", "--format", "grammar")
    assert (status, said) == (0, grammar(default_registry()))
