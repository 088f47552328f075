"""Mutants that no test can detect, because they change no observable behaviour."""

EQUIVALENT: list[tuple[str, str, str, str]] = [
    (
        "sar_compiler/nodes/binding/binder.py",
        "self._level += 1",
        "1 -> 2",
        "the level is only a bound: if it is too high, `nesting` counts the real depth of the tree",
    ),
    (
        "sar_compiler/checks/rules/outcome_analysis.py",
        '_YES_OR_NO: tuple[frozenset[str], ...] = (frozenset(), frozenset({"SUCCESS", "FAILURE"}))',
        "\"SUCCESS\" -> 'SUCCESSx'",
        "it only saves time: the rules find nothing in a tree that has only conditions",
    ),
    (
        "sar_compiler/nodes/outcome_sets.py",
        "for child, known in zip(bound.children, children, strict=True)",
        "True -> False",
        "there is always a set for each child; strict only detects a programming error",
    ),
    (
        "sar_compiler/nodes/nav2/__init__.py",
        'name="nav2.milliseconds",',
        "\"nav2.milliseconds\" -> 'nav2.millisecondsx'",
        "schemas refer to the type by this name, and any unique name works",
    ),
    (
        "sar_compiler/web/replay.py",
        "begin = min(firsts, default=0.0)",
        "0.0 -> 1.0",
        "if no journal has begun, the value is subtracted from itself",
    ),
    (
        "sar_compiler/ros/readiness.py",
        "_TURN_SEC = 0.05",
        "0.05 -> 1.05",
        "it is the polling interval, which changes only the delay of the report",
    ),
    (
        "sar_compiler/execution/serve.py",
        "_DISCOVERY_SEC, _CHECK_SEC = 5.0, 0.05",
        "0.05 -> 1.05",
        "it is a polling interval, too",
    ),
]
"""The module of each mutant, the text of the line, the change, and why it is not an error."""
