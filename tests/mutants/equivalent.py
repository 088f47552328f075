"""Mutants that no test can find, because they change nothing that anybody sees."""

EQUIVALENT: list[tuple[str, str, str, str]] = [
    (
        "sar_compiler/nodes/binding/binder.py",
        "self._level += 1",
        "1 -> 2",
        "the level is only a bound: where it is too high, `nesting` counts how deep the tree really is",
    ),
    (
        "sar_compiler/checks/rules/outcome_analysis.py",
        '_YES_OR_NO: tuple[frozenset[str], ...] = (frozenset(), frozenset({"SUCCESS", "FAILURE"}))',
        "\"SUCCESS\" -> 'SUCCESSx'",
        "it only saves time: the rules find nothing in a tree of nothing but questions",
    ),
    (
        "sar_compiler/nodes/outcome_sets.py",
        "for child, known in zip(bound.children, children, strict=True)",
        "True -> False",
        "there is a set for each child; strict would only tell a programmer that there is not",
    ),
    (
        "sar_compiler/nodes/nav2/__init__.py",
        'name="nav2.milliseconds",',
        "\"nav2.milliseconds\" -> 'nav2.millisecondsx'",
        "schemas refer to the type by it, and any name that no other type has will do",
    ),
    (
        "sar_compiler/web/replay.py",
        "begin = min(firsts, default=0.0)",
        "0.0 -> 1.0",
        "where no journal has begun it is subtracted from itself",
    ),
    (
        "sar_compiler/ros/readiness.py",
        "_TURN_SEC = 0.05",
        "0.05 -> 1.05",
        "it is how often the processor looks, and only says how soon somebody hears what is so either way",
    ),
    (
        "sar_compiler/execution/serve.py",
        "_DISCOVERY_SEC, _CHECK_SEC = 5.0, 0.05",
        "0.05 -> 1.05",
        "it is how often the processor looks, as well",
    ),
]
"""Each with its module, the line's text, the change, and why it is no mistake."""
