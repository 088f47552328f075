"""What docs/reference/yaml.md shows is so."""

import re
from pathlib import Path

from sar_compiler.tree.yaml import parse_yaml
from sar_compiler.tree.yaml_writer import write_yaml

PAGE = Path("docs/reference/yaml.md").read_text(encoding="utf-8")


def test_the_example_is_a_tree_in_canonical_form():
    example = re.findall(r"```yaml\n(.*?)```", PAGE, re.DOTALL)[0]
    assert write_yaml(parse_yaml(example)) == example


def test_what_is_said_to_be_a_text_is_read_as_this_text():
    texts = re.findall(r"^\| `(name: [^`]+)` \|[^|]*\| the string `([^`]+)` \|$", PAGE, re.MULTILINE)
    assert len(texts) == 3
    for written, text in texts:
        assert parse_yaml(f"root: {{{written}}}").root.attributes == {"name": text}


def test_what_is_said_to_be_written_is_read():
    for written in re.findall(r"\| `(\w+: '[^`]+')`", PAGE):
        assert len(parse_yaml(f"root:\n  {written}\n").root.attributes) == 1
