"""Check a ROS parameter file before ROS reads it.

ROS's parser (the parser of rcl, based on libyaml) accepts only a part of YAML, reports no column, and
silently misreads or ignores some content. This check rejects all content that the parser would reject,
misread or ignore, no matter to which node the content applies. It accepts all other content. The types of
scalars follow the rules of ROS's parser, not those of YAML.
"""

import difflib
import math
import re
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import yaml

from sar_compiler.errors import SarError
from sar_compiler.opener import PARAMETERS, read_file
from sar_compiler.tree.display_text import escape_to_one_line, shorten
from sar_compiler.tree.yaml_spans import SPLIT, split_number

_SECTION = "ros__parameters"
# The loader based on libyaml, if PyYAML includes it, is ten times as fast. ROS uses libyaml, too.
_LOADER: Any = getattr(yaml, "CBaseLoader", yaml.BaseLoader)
_PART = r"(?:\*\*?|[A-Za-z_][A-Za-z0-9_]*)"
_NODE_NAME = re.compile(rf"/?{_PART}(?:/{_PART})*")
_MAX_DEPTH = 64
_MAX_EVENTS = 100_000
"""The maximum number of YAML events in a file: names, values, and starts and ends of lists and mappings. A file with 30,000 parameters stays below this number."""
_SIGNS = re.compile("[:?]")


@dataclass(frozen=True)
class FileProblem:
    """An error in a parameter file.

    Attributes:
        line: The line, from 1; 0 for an error of the whole file.
        column: The column, from 1; 0 for an error of the whole file.
        text: The description of the error.
    """

    line: int
    column: int
    text: str

    @property
    def location(self) -> str:
        """The line and column, each after a colon; empty if the error concerns the whole file."""
        return f":{self.line}:{self.column}" if self.line else ""


class ParameterFileError(SarError):
    """ROS would reject or misread a parameter file.

    Attributes:
        file: The file as named by the user.
        line: The line of the first error, from 1; 0 for an error of the whole file.
        column: The column of the first error, from 1; 0 for an error of the whole file.
        problems: All errors, ordered by location.
    """

    def __init__(self, file: Path, problems: Iterable[FileProblem]) -> None:
        self.file = file
        self.problems = tuple(sorted(problems, key=lambda problem: (problem.line, problem.column)))
        self.line, self.column = self.problems[0].line, self.problems[0].column
        super().__init__(
            "\n".join(
                f"{file}{each.location}: {escape_to_one_line(shorten(each.text))}" for each in self.problems
            )
        )


def check_parameter_file(path: Path | str) -> None:
    """Check a ROS parameter file for content that ROS rejects or misreads.

    Raises:
        UnreadableFileError: If the file does not exist or cannot be read.
        ParameterFileError: If there are errors; lists all of them with their locations.
    """
    _sections(path)


def sections_elsewhere(paths: Iterable[Path | str], node: str) -> str:
    """Return a note that lists the sections of the files if no section applies to the given node.

    Args:
        paths: The files, which `check_parameter_file` accepts.
        node: The full name of the node, with its namespace.

    Returns:
        The note; empty if there are no files, or a section applies to the node.
    """
    files = list(paths)
    names = list(dict.fromkeys(name for path in files for name in _sections(path)))
    if not names or any(_is_for(name, node) for name in names):
        return ""
    whose = "the file's" if len(files) == 1 else "the files'"
    return f"{whose} sections are for {', '.join(names)}, but this node is {node}"


def read_parameter_file(path: Path | str, node: str) -> dict[str, object]:
    """Read a node's parameters from a file, with the values that ROS would read.

    Args:
        path: The parameter file.
        node: The full name of the node, with its namespace.

    Returns:
        The values by flat name (`points.yard.x`). If several sections apply to the node, a later section overrides an earlier one.

    Raises:
        ParameterFileError: If there are errors; lists all of them with their locations.
    """
    return {name: each.value for name, each in _values_for(path, node).items()}


class _Given(NamedTuple):
    """A parameter in a file: its value, and the YAML node of its name."""

    value: object
    name: yaml.Node


def _values_for(path: Path | str, node: str) -> dict[str, _Given]:
    """Return the parameters that a file contains for a node, by flat name."""
    sections = _sections(path).items()
    return {key: given for name, values in sections if _is_for(name, node) for key, given in values.items()}


class ParameterLocations:
    """The locations of a node's parameters in parameter files.

    Args:
        paths: The files, which `check_parameter_file` accepts. A later file overrides an earlier one.
        node: The full name of the node, with its namespace.
    """

    def __init__(self, paths: Iterable[Path | str], node: str) -> None:
        self._given: dict[str, tuple[object, str]] = {}
        self._beginning = ""
        for path in paths:
            given = _values_for(path, node)
            places = {name: f"{path}{_problem_at(each.name, '').location}" for name, each in given.items()}
            self._given |= {name: (each.value, places[name]) for name, each in given.items()}
            self._beginning = next(iter(places.values()), f"{path}:1:1")

    def location_of(self, key: str, parameters: Mapping[str, object]) -> str:
        """Return the file, line and column of a parameter.

        A missing parameter is located at a parameter of the nearest enclosing group that the files contain.
        If there is no such group, it is located at the first parameter of the last file. The result is empty
        if there are no files, or the parameter's value does not come from a file.

        Args:
            key: The flat name of the parameter.
            parameters: The node's parameters, some of which may be set on the command line.
        """
        if key in parameters:
            value, place = self._given.get(key, (None, ""))
            return place if repr(_to_plain_value(value)) == repr(_to_plain_value(parameters[key])) else ""
        group = key
        while group:
            for name, (_, place) in self._given.items():
                if name == group or name.startswith(f"{group}."):
                    return place
            group = group.rpartition(".")[0]
        return self._beginning


def _to_plain_value(value: object) -> object:
    """Convert a parameter value to plain Python, with lists instead of arrays."""
    return list(value) if isinstance(value, Iterable) and not isinstance(value, str) else value


def _sections(path: Path | str) -> dict[str, dict[str, _Given]]:
    """Return the parameters in each section of a file, by section name and flat parameter name.

    A section name may contain wildcards.

    Raises:
        ParameterFileError: If there are errors; lists all of them.
    """
    file = Path(path)
    reading = _Walk(_text_of(file))
    if reading.problems:
        raise ParameterFileError(file, reading.problems)
    return reading.sections


def _is_for(section: str, node: str) -> bool:
    """Return whether a section applies to a node.

    In the section's name, `*` matches one part of the node's name, and `**` matches any number of parts.
    """
    parts = {"**": r"(/\w+)*", "*": r"/\w+"}
    pattern = "".join(parts.get(part, "/" + re.escape(part)) for part in section.split("/")[1:])
    return re.fullmatch(pattern, node) is not None


def _text_of(file: Path) -> str:
    data = read_file(file, PARAMETERS).data
    wrong = f"the file is larger than {PARAMETERS.limit // 2**20} MiB, the limit of a parameter file"
    if len(data) <= PARAMETERS.limit:
        try:
            return data.decode("utf-8-sig")
        except UnicodeDecodeError as error:
            wrong = f"the file is not UTF-8 text (byte {error.start})"
    raise ParameterFileError(file, [FileProblem(0, 0, wrong)])


def _yaml_problem(error: yaml.MarkedYAMLError, text: str) -> FileProblem:
    mark = error.problem_mark or error.context_mark
    problem = error.problem or "cannot be parsed"
    if mark is not None and "cannot start any token" in problem and text[mark.index : mark.index + 1] == "\t":
        problem = "the line contains a tab. Indent it with spaces"
    elif error.context:
        problem = f"{error.context}: {problem}"
    line, column = (mark.line + 1, mark.column + 1) if mark is not None else (1, 1)
    return FileProblem(line, column, f"not YAML: {problem}")


def _problem_at(where: yaml.Node | yaml.Event, text: str) -> FileProblem:
    mark = where.start_mark
    return FileProblem(mark.line + 1, mark.column + 1, text) if mark is not None else FileProblem(1, 1, text)


def _needs_quotes(event: yaml.ScalarEvent) -> bool:
    return event.implicit[0] and _SIGNS.search(event.value) is not None


def _is_meant_for_section(key: str, value: yaml.Node) -> bool:
    """Return whether a key is probably a misspelt section name."""
    below = [each.value for each, _ in value.value] if isinstance(value, yaml.MappingNode) else []
    return _SECTION not in below and bool(difflib.get_close_matches(key.lower(), [_SECTION], 1, 0.9))


class _Walk:
    """Reads the text of a parameter file, and collects errors.

    Attributes:
        problems: All errors.
        sections: The parameters by section name and flat name; only valid if there are no errors.
    """

    def __init__(self, text: str) -> None:
        self._text = text
        self.problems: list[FileProblem] = []
        self.sections: dict[str, dict[str, _Given]] = {}
        try:
            self._read()
        except yaml.MarkedYAMLError as error:
            self.problems = [_yaml_problem(error, text)]
        except yaml.reader.ReaderError as error:
            line = text.count("\n", 0, error.position)
            column = error.position - (text.rfind("\n", 0, error.position) + 1)
            wrong = f"not YAML: delete the character {chr(error.character)!r}"
            self.problems = [FileProblem(line + 1, column + 1, wrong)]

    def _report(self, where: yaml.Node | yaml.Event, text: str) -> None:
        self.problems.append(_problem_at(where, text))

    def _read(self) -> None:
        self._check_events()
        if self.problems:
            return
        # This loader reads every scalar as a string, so YAML's rules for dates and numbers do not apply.
        root = yaml.compose(self._text, Loader=_LOADER)
        if root is None:
            wrong = f"the file is empty: write a node's name (or /**) and {_SECTION} below it"
            self.problems = [FileProblem(1, 1, wrong)]
        elif not isinstance(root, yaml.MappingNode):
            wrong = f"the file must be a mapping: write a node's name (or /**), below it {_SECTION}, and below that the parameters"
            self._report(root, wrong)
        else:
            self._nodes(root, "", "")

    def _check_events(self) -> None:
        """Report YAML features that ROS does not support, and content that is too large or too deeply nested.

        The older libyaml in some versions of ROS rejects some characters in plain scalars within brackets.
        """
        documents = brackets = depth = 0
        for event in self._events():
            if isinstance(event, yaml.DocumentStartEvent):
                documents += 1
                if event.version is not None and tuple(event.version) != (1, 1):
                    version = f"%YAML {event.version[0]}.{event.version[1]}"
                    self._report(event, f"ROS reads YAML 1.1 only: delete '{version}'")
                if documents == 2:  # noqa: PLR2004
                    self._report(
                        event,
                        "ROS would merge this second document (---) into the first one: delete one of the two documents",
                    )
            elif isinstance(event, yaml.AliasEvent):
                self._report(
                    event, f"ROS does not support aliases: write the value of '*{event.anchor}' in full"
                )
            elif isinstance(event, yaml.CollectionStartEvent):
                brackets += bool(event.flow_style)
                depth += 1
                if depth > _MAX_DEPTH:
                    self._report(
                        event, f"the file is nested too deeply here: use at most {_MAX_DEPTH} levels"
                    )
                    return
            elif isinstance(event, yaml.CollectionEndEvent):
                brackets = max(brackets - 1, 0)
                depth -= 1
            elif isinstance(event, yaml.ScalarEvent) and brackets and _needs_quotes(event):
                why = "needs quotes within [] and {}, because some versions of ROS reject ':' and '?' there"
                self._report(event, f"'{event.value}' {why}")

    def _events(self) -> Iterator[Any]:
        for number, event in enumerate(yaml.parse(self._text, Loader=_LOADER)):
            if number > _MAX_EVENTS:
                text = f"the file has more than {_MAX_EVENTS:,} names and values, which is the limit for a parameter file"
                self._report(event, text)
                return
            yield event

    def _nodes(self, mapping: yaml.MappingNode, name: str, above: str) -> None:
        """Read the names of nodes and namespaces, which may be nested, and the parameters below these names."""
        if not mapping.value:
            whose = f"'{name}' has no {_SECTION} below it" if name else f"has no {_SECTION}"
            self._report(mapping, whose)
        self._keys(mapping)
        for key, value in mapping.value:
            if not isinstance(key, yaml.ScalarNode):
                continue
            if key.value != _SECTION:
                self._node(key, value, above)
            elif not name:
                self._report(key, f"{_SECTION} has no node name above it: write a node name, or /**")
            elif isinstance(value, yaml.MappingNode):
                given: dict[str, _Given] = {}
                self._parameters(value, "", given)
                self.sections.setdefault(above, {}).update(given)
            else:
                self._report(key, f"{_SECTION} must contain parameters, each written as 'name: value'")

    def _node(self, key: yaml.ScalarNode, value: yaml.Node, above: str) -> None:
        if _is_meant_for_section(key.value, value):
            self._report(key, f"'{key.value}': did you mean '{_SECTION}' (two underscores)?")
        elif isinstance(value, yaml.MappingNode):
            if _SECTION in key.value or not _NODE_NAME.fullmatch(key.value):
                text = (
                    "is not a valid node name or namespace: use letters, digits, _, * and **, separated by /"
                )
                self._report(key, f"'{key.value}' {text}")
            self._nodes(value, key.value, f"{above}/{key.value.strip('/')}")
        else:
            self._report(key, f"'{key.value}' is outside of {_SECTION}: indent it below {_SECTION}")

    def _keys(self, mapping: yaml.MappingNode) -> None:
        seen: dict[str, int] = {}
        for key, _ in mapping.value:
            if not isinstance(key, yaml.ScalarNode):
                self._report(key, "a key must be a name, not a list or a mapping")
            elif not key.value:
                self._report(key, "a name is missing before this ':'")
            elif key.value in seen:
                self._report(key, f"'{key.value}' is given twice (first in line {seen[key.value]})")
            else:
                seen[key.value] = key.start_mark.line + 1

    def _parameters(self, mapping: yaml.MappingNode, prefix: str, given: dict[str, _Given]) -> None:
        self._keys(mapping)
        here: set[str] = set()
        for key, value in mapping.value:
            if not isinstance(key, yaml.ScalarNode) or key.value in here:
                continue
            here.add(key.value)
            name = prefix + key.value
            split = split_number(self._text, key.start_mark.index, key.end_mark.index)
            if split is not None and value.value == "":
                remedy = f"write {split.meant} with a point" if split.meant is not None else split.hint
                self._report(key, f"{SPLIT.format(split.written)}: {remedy}")
                continue
            if isinstance(value, yaml.MappingNode):
                if not value.value:
                    self._report(value, f"'{name}' is empty: delete it")
                self._parameters(value, f"{name}.", given)
                continue
            # `a.b: 1` and `a: {b: 2}` set the same parameter.
            if name in given:
                first = given[name].name.start_mark.line + 1
                self._report(key, f"'{name}' is given twice (first in line {first})")
            is_list = isinstance(value, yaml.SequenceNode)
            given[name] = _Given(self._list(name, value) if is_list else self._scalar(name, value), key)

    def _list(self, name: str, sequence: yaml.SequenceNode) -> list[object]:
        if not sequence.value:
            # A node cannot declare an array without a type.
            wrong = "is an empty list, whose type ROS cannot determine: add values, or delete the parameter"
            self._report(sequence, f"'{name}' {wrong}")
        values: list[object] = []
        kinds: list[str] = []
        for entry in sequence.value:
            if not isinstance(entry, yaml.ScalarNode):
                what = "mappings" if isinstance(entry, yaml.MappingNode) else "lists"
                only = "but ROS only reads lists of strings, numbers or Booleans"
                self._report(entry, f"'{name}' is a list of {what}, {only}")
                break
            values.append(self._scalar(name, entry))
            kinds.append(self._kind(entry))
            if kinds[-1] != kinds[0]:
                hint = " (write 1.0 for 1)" if {kinds[-1], kinds[0]} == {"an integer", "a number"} else ""
                mixed = f"'{name}' mixes {kinds[0]} with {kinds[-1]}: all values of a list must have the same type{hint}"
                self._report(entry, mixed)
                break
        return values

    def _scalar(self, name: str, node: yaml.ScalarNode) -> object:
        """Return the value that ROS would read; report a value that ROS probably reads differently than intended."""
        text = node.value
        if node.tag != "tag:yaml.org,2002:str":
            # ROS ignores tags: it reads `!degrees 90` as 90 and `!!int '3'` as a string.
            self._report(node, f"'{name}' has the tag {node.tag}, which ROS ignores: delete the tag")
        elif self._is_text(node):
            return text
        elif text == "":
            self._report(node, f"'{name}' has no value: write a value, or delete the parameter")
        elif text in ("~", "null", "Null", "NULL"):
            empty = "which ROS would read as a string, because it has no empty values"
            self._report(node, f"'{name}' is {text}, {empty}")
        elif re.fullmatch(r"[+-]?0[0-7]+", text) and int(text, 8) != int(text):
            octal = f"which ROS reads as the octal number {int(text, 8)}: omit the leading 0"
            self._report(node, f"'{name}' is {text}, {octal}")
        elif rcl_kind(text) == "text" and _means_number(text):
            digits = "which ROS reads as a string instead of a number: write it in plain digits"
            self._report(node, f"'{name}' is {text}, {digits}")
        return _READ[self._kind(node)](text)

    def _kind(self, node: yaml.ScalarNode) -> str:
        return "text" if self._is_text(node) else rcl_kind(node.value)

    def _is_text(self, node: yaml.ScalarNode) -> bool:
        # An explicit tag begins at the node's start, and only the tag !!str can occur here.
        return (
            node.style in ("'", '"') or self._text[node.start_mark.index : node.start_mark.index + 1] == "!"
        )


_BOOLS = frozenset(
    word
    for lower in ("y", "yes", "true", "on", "n", "no", "false", "off")
    for word in (lower, lower.capitalize(), lower.upper())
)
_INTEGER = re.compile(r"[+-]?(0[xX][0-9a-fA-F]+|0[0-7]*|[1-9][0-9]*)")
_DECIMAL = re.compile(r"[+-]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][+-]?[0-9]+)?")
_HEXADECIMAL = re.compile(r"[+-]?0[xX]([0-9a-fA-F]+\.?[0-9a-fA-F]*|\.[0-9a-fA-F]+)([pP][+-]?[0-9]+)?")
_WORDS = re.compile(r"[+-]?(inf|infinity|nan)|[+-]?\.inf|\.nan", re.IGNORECASE)


def rcl_kind(text: str) -> str:
    """Return the type of an unquoted scalar according to ROS's parser.

    The parser uses the rules of C's `strtol` (base 0) and `strtod` instead of YAML's rules: `1e3` and `0x10`
    are numbers. `1_000` and `0o10` are text. A number that is too large for a double is text, too.

    Returns:
        `a Boolean`, `an integer`, `a number` or `text`.
    """
    if text in _BOOLS:
        return "a Boolean"
    if _INTEGER.fullmatch(text) and -(2**63) <= _c_integer(text) < 2**63:
        return "an integer"
    if _DECIMAL.fullmatch(text):
        return "text" if math.isinf(float(text)) else "a number"
    return "a number" if _HEXADECIMAL.fullmatch(text) or _WORDS.fullmatch(text) else "text"


def _c_integer(text: str) -> int:
    digits = text.lstrip("+-").lower()
    base = 16 if digits.startswith("0x") else 8 if digits.startswith("0") else 10
    return int(text, base)


def _c_double(text: str) -> float:
    # YAML writes infinity and NaN with a leading dot, C and Python without one.
    plain = text.lower().replace(".inf", "inf").replace(".nan", "nan")
    return float.fromhex(plain) if "0x" in plain else float(plain)


_READ: Mapping[str, Callable[[str], object]] = {
    "a Boolean": lambda text: text.lower() in ("y", "yes", "true", "on"),
    "an integer": _c_integer,
    "a number": _c_double,
    "text": str,
}


def _means_number(text: str) -> bool:
    for read in (float, lambda written: int(written, 0)):
        try:
            read(text)
        except ValueError:
            continue
        return True
    return False
