"""All kinds of findings: their codes, how bad they are unless somebody decides otherwise, and what they say.

Each has a page in `docs/findings/`, which `sar-compile explain` shows.
"""

from dataclasses import dataclass

from sar_compiler.resources import shipped
from sar_compiler.tree.diagnostic import Severity


@dataclass(frozen=True)
class FindingKind:
    """A kind of finding.

    Attributes:
        code: Its name, in kebab-case words.
        severity: How bad it is by default.
        summary: What it says, in half a sentence.
    """

    code: str
    severity: Severity
    summary: str


_ERRORS = {
    "ambiguous-reference": "a reference that several nodes could be meant by",
    "child-of-leaf": "nodes in a leaf, which takes none",
    "circular-reference": "a reference to the node itself, or round in a circle",
    "conflicting-attributes": "attributes that contradict each other, or the tag",
    "conflicting-keys": "keys of a property that exclude each other",
    "constructor-failed": "the leaf itself refuses its values",
    "doctype": "a DOCTYPE in a tree file",
    "duplicate-key": "a key of YAML written twice",
    "duplicate-model": "a second TreeNodesModel, or a second description of a node or port",
    "duplicate-name": "two nodes of one name where one of them is referred to",
    "duplicate-tree-id": "two trees of one ID",
    "empty-control": "a control without children",
    "empty-file": "a file with nothing in it",
    "file-too-large": "a file larger than any tree",
    "include-cycle": "files that include each other",
    "include-outside": "an included file in a folder that was not allowed",
    "interrupted-child": "a second AsyncSequence in a ReactiveSequence",
    "key-of-two-types": "a key that two ports want of different types",
    "malformed-toml": "a configuration that is not TOML",
    "malformed-xml": "not well-formed XML",
    "malformed-yaml": "not YAML",
    "missing-attribute": "an attribute that must be written",
    "missing-child": "a decorator, or a tree, without the node that belongs in it",
    "missing-context": "a leaf that needs an object which the run does not have",
    "missing-key": "a property without a key that it needs",
    "missing-main-tree": "the tree to execute is not in the file",
    "missing-reference": "a leaf that refers to a node of a kind that is not in the tree",
    "missing-tree-id": "a tree without an ID where it needs one",
    "missing-value": "a key of YAML with nothing behind it",
    "model-mismatch": "a TreeNodesModel that contradicts the node that is installed",
    "no-main-tree": "several trees, and none is named to be executed",
    "no-tree": "a file without a tree",
    "not-in-yaml": "something that YAML cannot have",
    "not-installed": "a node to be run that only a model describes",
    "out-of-reach": "a count of children that can never be reached",
    "processing-instruction": "a processing instruction of XML",
    "recursive-tree": "a tree in itself",
    "schema": "something that the XML schema refuses and no rule explains",
    "script-error": "a text that is not a script",
    "second-document": "a second document of YAML",
    "skip-misread": "a skipped child that the node around it would take for an interruption",
    "stray-text": "text between elements",
    "too-deep": "elements nested deeper than can be run",
    "too-many-children": "more children than the node takes",
    "too-many-includes": "more included files than are read",
    "too-many-nodes": "more nodes than can be run, with all subtrees in place",
    "unknown-answer": "an answer that the leaf cannot give",
    "unknown-attribute": "an attribute that the element does not have",
    "unknown-element": "an element that cannot stand there",
    "unknown-fact": "a fact that no leaf of the tree knows",
    "unknown-key": "a parameter that the mission does not have, or a key that a file cannot have",
    "unknown-leaf": "a leaf that the tree does not have",
    "unknown-node": "a tag that means no node",
    "unknown-package": "a ROS package that is not installed",
    "unknown-reference": "a reference to a name that no node has",
    "unknown-setting": "a setting that the configuration cannot have",
    "unknown-tree": "a subtree that is in no file",
    "unreadable-include": "an included file that cannot be read",
    "wrong-character": "a character that no tree file can have",
    "wrong-condition": "a condition that cannot be asked",
    "wrong-encoding": "bytes that are no text",
    "wrong-format": "a BTCPP_format other than 4",
    "wrong-kind": "an explicit form with the wrong kind",
    "wrong-name": "a word that cannot be a name",
    "wrong-reference": "a reference to a node of another kind",
    "wrong-root": "another outermost element than root",
    "wrong-setting": "a setting with a value that it cannot have",
    "wrong-shape": "a list, a mapping or a text where YAML has something else",
    "wrong-tree-id": "an ID that no tree can have",
    "wrong-value": "a text that is not of the attribute's type",
    "yaml-anchor": "an anchor or an alias of YAML",
    "yaml-directive": "a directive of YAML",
    "yaml-merge": "a merge key of YAML",
    "yaml-tag": "a tag of YAML",
}
_WARNINGS = {
    "assignment-as-condition": "a condition that gives a variable a value",
    "cancelled-branch": "branches of a parallel of which one interrupts the others' work",
    "interrupted-action": "an action that is interrupted in every tick in which it runs",
    "endless-restart": "two children of which one interrupts the other again and again",
    "never-ends": "a node that ticks its child for ever",
    "no-counterpart": "something that BehaviorTree.CPP has nothing for",
    "out-of-step": "children of a parallel that must succeed in the same tick, and hardly ever do",
    "overwritten-key": "a key written twice before anybody reads it",
    "read-before-write": "a key read before it can have been written",
    "repeated-effect": "an action that is done again in tick after tick",
    "shared-action": "two leaves that send goals to one server at the same time",
    "shared-key": "two branches of a parallel write one key",
    "unclosed-key": "a text with only one of a key's braces",
    "unneeded-allow": "an allow comment that silences nothing",
    "unreachable-node": "a node that is never ticked",
    "unused-argument": "a subtree is given a key that it does nothing with",
    "unused-tree": "a tree that no other uses",
    "unwritten-key": "a key that is read and never written",
    "without-effect": "a node that changes nothing",
    "wrong-allow": "an allow comment that cannot silence what it names",
    "wrong-order": "a leaf that comes before, or behind, what it works with",
}
_INFOS = {
    "changed": "a comment that the other form cannot have as it is",
    "differs": "something that is a little different in BehaviorTree.CPP",
    "left-out": "something that is not taken along into the other form",
    "lost-progress": "a sequence that begins again whenever it was interrupted",
    "needless-node": "a node that could be left out",
    "moved": "a comment that stands elsewhere in the other form",
    "not-converted": "an included file that is not converted with the one that includes it",
    "only-described": "what stands in a simulated run for a node that only a model describes",
    "reference": "a reference, which is only a text to BehaviorTree.CPP",
    "same-name": "two nodes of one name side by side",
    "separator-in-name": "a name with a sign in it that separates names",
    "short-timeout": "a timeout hardly longer than a tick",
    "unread-key": "a key that is written and never read",
}

KINDS = {
    code: FindingKind(code, severity, summary)
    for severity, summaries in (
        (Severity.ERROR, _ERRORS),
        (Severity.WARNING, _WARNINGS),
        (Severity.INFO, _INFOS),
    )
    for code, summary in summaries.items()
}
"""All kinds, by their code."""


def page_of(code: str) -> str:
    """Return the page about a kind of finding, in Markdown.

    Raises:
        ResourceError: If it is not installed.
    """
    return shipped("docs/findings", f"{code}.md").read_text("utf-8")


def is_firm(code: str) -> bool:
    """Say whether a kind is an error by default: such a tree cannot be run, so nobody can decide otherwise."""
    kind = KINDS.get(code)
    return kind is not None and kind.severity is Severity.ERROR
