"""All kinds of findings: their codes, default severities and summaries.

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
    "circular-reference": "a reference that leads back to its own node",
    "conflicting-attributes": "attributes that contradict each other, or the tag",
    "conflicting-keys": "keys of a property that exclude each other",
    "constructor-failed": "a constructor that refuses its values",
    "doctype": "a DOCTYPE in a tree file",
    "duplicate-key": "a YAML key written twice",
    "duplicate-model": "a second TreeNodesModel, or a second description of a node or port",
    "duplicate-name": "two nodes of one name where one of them is referred to",
    "duplicate-tree-id": "two trees of one ID",
    "empty-control": "a control without children",
    "empty-file": "a file with nothing in it",
    "file-too-large": "a file above the size limit",
    "include-cycle": "files that include each other",
    "include-outside": "an included file outside the allowed folders",
    "interrupted-child": "a second AsyncSequence in a ReactiveSequence",
    "key-of-two-types": "a key used by two ports of different types",
    "malformed-toml": "a configuration that is not TOML",
    "malformed-xml": "not well-formed XML",
    "malformed-yaml": "not YAML",
    "missing-attribute": "an attribute that must be written",
    "missing-child": "a decorator or a tree without its child",
    "missing-context": "a leaf that needs a context object that the run does not provide",
    "missing-key": "a YAML mapping without a key that it needs",
    "missing-main-tree": "a main tree that is not in the file",
    "missing-reference": "a leaf that refers to a node of a kind that is not in the tree",
    "missing-tree-id": "a tree without an ID where it needs one",
    "missing-value": "a YAML key without a value",
    "model-mismatch": "a TreeNodesModel that contradicts the installed node",
    "no-main-tree": "several trees, and no `main_tree_to_execute`",
    "no-tree": "a file without a tree",
    "not-in-yaml": "XML content that YAML cannot express",
    "not-installed": "a node that only a model describes, in a tree to be run",
    "out-of-reach": "a count of children that is never reached",
    "processing-instruction": "an XML processing instruction",
    "recursive-tree": "a tree that contains itself",
    "schema": "a violation of the XML schema that no other finding explains",
    "script-error": "a syntax error in a script",
    "second-document": "a second YAML document in a file",
    "several-missions": "leaves of several missions in one tree",
    "setting-outside": "a path in the configuration that leads out of the repository",
    "skip-misread": "a child that may be skipped, below a node that would take this for an interruption",
    "stray-text": "text between elements",
    "too-deep": "elements nested too deeply to be run",
    "too-many-children": "more children than the node can have",
    "too-many-includes": "more included files than the limit",
    "too-many-nodes": "more nodes than can be run, counting each use of a subtree",
    "unknown-answer": "an answer that the leaf cannot give",
    "unknown-attribute": "an attribute that the element does not have",
    "unknown-element": "an element at a place where it is not allowed",
    "unknown-fact": "a fact that no leaf of the tree knows",
    "unknown-key": "an unknown mission parameter, or an unknown key in a file",
    "unknown-leaf": "a leaf that the tree does not have",
    "unknown-node": "a tag that is not a known node",
    "unknown-package": "a ROS package that is not installed",
    "unknown-reference": "a reference to a name that no node has",
    "unknown-tree": "a reference to a tree that is in no file",
    "unreadable-include": "an included file that cannot be read",
    "untrusted-nodes": "a module in the configuration that is neither installed nor trusted",
    "wrong-character": "a character that is not allowed in a tree file",
    "wrong-condition": "a condition that is not allowed at its place",
    "wrong-encoding": "bytes that are not valid in the file's encoding",
    "wrong-format": "a BTCPP_format other than 4",
    "wrong-kind": "a node in explicit form under the wrong kind",
    "wrong-name": "an invalid name",
    "wrong-reference": "a reference to a node of another kind",
    "wrong-root": "an outermost element other than root",
    "wrong-shape": "a list, a mapping or a text where another of these is expected",
    "wrong-tree-id": "an invalid tree ID",
    "wrong-value": "a value that does not fit the attribute's type",
    "yaml-anchor": "a YAML anchor or alias",
    "yaml-directive": "a YAML directive",
    "yaml-merge": "a YAML merge key",
    "yaml-tag": "a YAML tag",
}
_WARNINGS = {
    "assignment-as-condition": "a condition that assigns a variable",
    "cancelled-branch": "a branch of a parallel that interrupts the others before they finish",
    "interrupted-action": "an action that is interrupted in every tick in which it runs",
    "endless-restart": "a child that interrupts another one again and again",
    "never-ends": "a node that repeats its child without end",
    "no-counterpart": "an element or attribute without a counterpart in BehaviorTree.CPP",
    "out-of-step": "children of a parallel that must succeed in the same tick, which is unlikely",
    "overwritten-key": "a key that is overwritten before it is read",
    "read-before-write": "a key read before it can have been written",
    "repeated-effect": "an action that is repeated in every tick",
    "shared-action": "two leaves that send goals to one server at the same time",
    "shared-key": "a key written by two branches of a parallel",
    "unclosed-key": "a value with only one of a key's braces",
    "unneeded-allow": "an allow comment that suppresses nothing",
    "unreachable-node": "a node that is never ticked",
    "unused-argument": "a key passed to a subtree that does not use it",
    "unused-tree": "a tree that no other uses",
    "unwritten-key": "a key that is read and never written",
    "without-effect": "a decorator that has no effect",
    "wrong-allow": "an allow comment that cannot suppress what it names",
    "wrong-order": "a leaf before the one that it depends on, or after one that undoes it",
}
_INFOS = {
    "changed": "a comment that conversion had to reword",
    "differs": "a node or attribute that behaves slightly differently in BehaviorTree.CPP",
    "left-out": "content that conversion leaves out",
    "lost-progress": "a sequence that starts over after each interruption",
    "needless-node": "a node that could be left out",
    "moved": "a comment that conversion had to move",
    "not-converted": "an included file that is not converted with the one that includes it",
    "only-described": "a node that only a model describes, replaced in a simulated run",
    "reference": "a reference, which BehaviorTree.CPP treats as a plain text",
    "same-name": "two siblings of one name",
    "separator-in-name": "a name with a character that separates names",
    "short-timeout": "a timeout that is hardly longer than a tick period",
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
    """Return whether a kind is an error by default; such a tree cannot be run, so no setting changes it."""
    kind = KINDS.get(code)
    return kind is not None and kind.severity is Severity.ERROR
