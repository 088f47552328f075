"""What is to be reached, and where it was before."""

from collections.abc import Mapping
from typing import NamedTuple

from benchmarks import (
    editing,
    flying,
    journaling,
    large_files,
    ordering,
    paging,
    pipeline,
    predicting,
    startup,
    sweeping,
    ticking,
    verifying,
    watched_properties,
)
from benchmarks.peers import COMPILED


class Goal(NamedTuple):
    """One row of the table of goals.

    Attributes:
        what: What it is about.
        before: What it was, as measured then.
        benchmark: Whose figure it is.
        subject: The subject of the figure.
        limits: The most that the ratio beside each reference may be, or, for the reference "", the subject itself in
            its unit. Empty where it only has to be measured, which is to say that it came to an end.
        how: How it is measured.
        unit: The figure's unit, a key of `tables.UNITS`.
    """

    what: str
    before: str
    benchmark: str
    subject: str
    limits: Mapping[str, float]
    how: str
    unit: str = "s"


_IN_PARTS = f"balanced tree of {pipeline.SIZE:,} leaves, step by step in turns"
_LARGE = f"{pipeline.SIZE:,} leaves"

GOALS = (
    Goal(
        "tick 10,000 leaves (own `update` only), as `sar-run` does",
        "128 ms with py_trees' generators, 39 ms on the flat form; BehaviorTree.CPP 5.8 ms, bare calls 4.0 ms",
        "ticking",
        ticking.subject("balanced", 10_000),
        {COMPILED: 1.5, ticking.BARE: 2.0},
        "`LiveTree.tick`; BehaviorTree.CPP with leaves in C++, by `behaviortreepy`",
    ),
    *(
        Goal(
            f"one leaf of {size:,} runs, all before it are done",
            before,
            "ticking",
            ticking.subject("one leaf runs", size),
            {COMPILED: 2.0},
            "the same",
        )
        for size, before in (
            (100, "3.3 x BehaviorTree.CPP"),
            (1_000, "14 x"),
            (10_000, "151 x"),
            (100_000, "not measured"),
        )
    ),
    *(
        Goal(
            f"{shape}, {size:,}",
            before,
            "ticking",
            ticking.subject(shape, size),
            {COMPILED: limit},
            "the same",
        )
        for shape, size, before, limit in (
            ("built-in leaves", 1_000, "6.0 x BehaviorTree.CPP", 1.2),
            ("built-in leaves", 10_000, "4.3 x", 1.2),
            ("leaves that begin and end", 1_000, "2.1 to 2.8 x", 2.0),
            ("mixed", 100, "5.1 to 7.0 x, on other trees", 2.0),
            ("mixed", 1_000, "7.9 to 21.9 x, on other trees", 2.0),
            ("scripts", 1_000, "8.7 to 13 x", 1.0),
            ("scripts", 10_000, "not measured", 1.0),
            ("conditions", 1_000, "8.7 to 13 x", 1.0),
            ("ports", 1_000, "4.7 to 5.0 x", 1.0),
            ("ports", 10_000, "not measured", 1.0),
            ("Nav2's shape", ticking.OF_NAV2[0], "2.9 x, on Nav2's own twelve", 1.5),
        )
    ),
    Goal(
        "`sar-compile sweep`, runs a second and core",
        "394 runs/s: the tree was compiled in each run",
        "sweep",
        sweeping.subject("plain"),
        {"": 1 / 2_000},
        "the plain mission, every tenth answer an unusual one",
        "s/run",
    ),
    Goal(
        "`sar-sim sweep`, missions a minute",
        "6 missions/min",
        "sweep",
        sweeping.FLOWN,
        {"": 1.0},
        "the shipped mission, time that passes, as many at a time as there are processors",
        "s/mission",
    ),
    Goal(
        "`predict`, states a second",
        "a prototype on Python: 1,500 states/s",
        "predict",
        predicting.SUBJECT,
        {"": 1 / 20_000},
        "resilient mission, five zones, with all that is told: 10^5 states in 5 s",
        "s/state",
    ),
    Goal(
        "`predict`, memory",
        "nothing of the kind",
        "predict",
        f"{predicting.LARGE}: memory",
        {"": 4e9},
        "resilient mission, eight zones, more than 10^6 states: the most that the process has had",
        "bytes",
    ),
    *(
        Goal(what, "a beam search: 200 zones 55 s and 583 MB", "order", what, {"": most}, how, unit)
        for count in ordering.COUNTS
        for what, most, how, unit in (
            (ordering.subject(count), 2.0, "`expected_find`, straight lines as ways, CPU time", "s"),
            (
                f"{ordering.subject(count)}: memory",
                200e6,
                "the most that a process has that does it",
                "bytes",
            ),
        )
    ),
    Goal(
        "what its chain adds to a fact of the journal",
        "a fact without a chain",
        "journal",
        journaling.FACT,
        {journaling.UNCHAINED: 1.1},
        "time that passes, on the disk of the temporary folder, with and without links in turns",
    ),
    Goal(
        "a flight that is watched for properties",
        "a prototype of the automaton alone: 0.31 µs",
        "properties",
        watched_properties.SUBJECT,
        {"": 1e-6},
        "resilient mission, seven properties; of each event the conditions, the facts and the monitors",
        "s/event",
    ),
    Goal(
        "`verify`, states a second, nothing forgotten",
        "2,000 states/s; SPIN on a like model 198,000 (see below)",
        "verify",
        verifying.RESILIENT_UNFORGOTTEN,
        {"": 1 / 200_000},
        "resilient mission, four zones, CPU time of all processes",
        "s/state",
    ),
    Goal(
        "`verify`, memory",
        "430 to 940 bytes a state",
        "verify",
        verifying.MEMORY,
        {"": 200.0},
        "growth of the process over the second half of 100,000 states, nine zones; 10^7 states in 2 GB are 200 bytes each",
        "bytes/state",
    ),
    Goal(
        "BehaVerify's binary tree, 2,055 nodes",
        "39 nodes not in 300 s; BehaVerify 23 s, MoVe4BT 1,031 nodes in 34 s (on their machines)",
        "verify",
        verifying.binary_subject(10),
        {"": 5.0},
        "`sar-compile verify` from the shell, CPU time",
    ),
    Goal(
        "BehaVerify's binary tree, 8,199 nodes",
        "not measured",
        "verify",
        verifying.binary_subject(12),
        {},
        f"the same; given up after {verifying.PATIENCE_SEC} s",
    ),
    Goal(
        "200 retried leaves in a Sequence",
        "not done in 120 s",
        "verify",
        verifying.RETRIED,
        {},
        f"the same; given up after {verifying.PATIENCE_SEC} s",
    ),
    *(
        Goal(
            verifying.parallel_subject(count),
            before,
            "verify",
            verifying.parallel_subject(count),
            limits,
            f"the same; given up after {verifying.PATIENCE_SEC} s",
        )
        for count, before, limits in (
            (4, "11 s", {}),
            (5, "not done in 250 s", {}),
            (6, "three hours, estimated", {"": 10.0}),
            (20, "10^18 states", {"": 60.0}),
        )
    ),
    Goal(
        verifying.NAV2_SHAPE,
        "the largest of Nav2's own 22 s",
        "verify",
        verifying.NAV2_SHAPE,
        {"": 3.0},
        "the same; Nav2's own, by hand: each below 1.7 s",
    ),
    Goal(
        "the resilient mission with 8 zones",
        "not measured",
        "verify",
        verifying.EIGHT_ZONES,
        {},
        f"the same; given up after {verifying.PATIENCE_SEC} s",
    ),
    Goal(
        "`validate` of the shipped tree",
        "5.3 to 6.0 x `import lxml.etree`",
        "startup",
        startup.VALIDATE,
        {startup.LXML: 3.0},
        "processes of an environment without ROS",
    ),
    Goal(
        "`sar-run` without `--sim`, to the first tick",
        "not measured",
        "startup",
        startup.FIRST_TICK,
        {startup.BARE_NODE: 3.0},
        "servers up in processes of their own; CPU time",
    ),
    Goal(
        "`sar-run --sim --speed 1000`, until the first goal is sent",
        "6 s",
        "startup",
        startup.FIRST_GOAL,
        {"": 3.0},
        "time that passes, from the command on",
    ),
    Goal(
        "`sar-run --sim --speed 1000`, until the summary",
        "14.5 s",
        "startup",
        startup.SUMMARY,
        {"": 6.0},
        "time that passes, from the command on",
    ),
    *(
        Goal(
            f"`sar-run` while it drives, {rate} ticks a second",
            before,
            "flight",
            flying.subject(rate),
            {flying.BARE: 1.2},
            "the same goal, sent by a node on `SingleThreadedExecutor` that hears its feedback, and has a timer at this rate",
            "core",
        )
        for rate, before in ((2, "not measured"), (10, "2 to 3 x"), (100, "1.9 to 2.3 x"))
    ),
    *(
        Goal(
            f"what `{option}` adds to that, {rate} ticks a second",
            f"{before} points",
            "flight",
            flying.points(option, rate),
            {"": before / 200},
            "the same run with and without it, in turns; half of before",
            "core",
        )
        for rate, points in (
            (10, (1.3, 3.5, 3.5, 1.4, 6.5)),
            (100, (6.3, 9.9, 9.8, 4.0, 12.4)),
        )
        for option, before in zip(flying.OPTIONS, points, strict=False)
    ),
    Goal(
        "memory of `sar-run` while it drives",
        "92 MB; a bare node 68",
        "flight",
        flying.MEMORY,
        {flying.BARE: 1.4},
        "what it has in memory (VmRSS), 10 ticks a second",
        "bytes",
    ),
    Goal(
        "a tick that a journal watches, 1,000 leaves of which one runs",
        "327 µs",
        "journal",
        journaling.ONE_RUNS,
        {"": 50e-6},
        "no node changes",
    ),
    Goal(
        "10,000 leaves with ports: read, check, compile",
        "3.1 s; BehaviorTree.CPP creates it in 0.13 s",
        "pipeline",
        pipeline.subject("ports"),
        {"": 1.0},
        "from the text to the tree; BehaviorTree.CPP from the file to the tree",
    ),
    *(
        Goal(
            f"create {pipeline.CREATED:,} leaves ({shape}), without checks",
            before,
            "pipeline",
            pipeline.created(shape),
            {COMPILED: 4.0},
            "from the text to the tree; BehaviorTree.CPP from the file to the tree",
        )
        for shape, before in (("balanced", "7.7 x"), ("ports", "9.0 x"), ("scripts", "18.9 x"))
    ),
    Goal(
        "read a file",
        "2.9 to 3.2 x expat",
        "pipeline",
        f"read {_LARGE}",
        {pipeline.EXPAT: 3.0},
        f"{_IN_PARTS}; expat with handlers that do nothing",
    ),
    Goal("check it", "1.9 to 2.2 x reading", "pipeline", f"check {_LARGE}", {pipeline.READ: 2.0}, _IN_PARTS),
    Goal(
        "compile it",
        "1.5 x by hand",
        "pipeline",
        f"compile {_LARGE}",
        {pipeline.BY_HAND: 1.5},
        f"{_IN_PARTS}; hand-written py_trees constructors",
    ),
    Goal(
        "memory from file to tree",
        "2.0 x by hand",
        "pipeline",
        f"memory of {_LARGE}",
        {pipeline.BY_HAND: 2.0},
        "the most that Python holds at a time (`tracemalloc`)",
    ),
    Goal(
        "from file to tree",
        "1/14 of py_trees' own parser",
        "pipeline",
        pipeline.PARSED,
        {pipeline.THEIR_PARSER: 0.05},
        f"balanced tree of {pipeline.SIZE:,} leaves; without checks",
    ),
    Goal(
        f"{large_files.SIZE:,} of whatever a file may be full of: read, check, compile",
        "quadratic in three of them",
        "large-files",
        large_files.SLOWEST,
        {"": 10.0},
        "the slowest of the files below",
    ),
    Goal(
        "`sar-run --view web`, while five browsers look",
        "there was no page",
        "page",
        paging.CORE,
        {"": 0.05},
        "thirty leaves, ten ticks a second; what the process takes more than without a page",
        "core",
    ),
    Goal(
        "a tick while five browsers look",
        "there was no page",
        "page",
        paging.TICK,
        {paging.NONE: 1.1},
        "the same; the median of what passes",
    ),
    Goal(
        "the first picture of `sar-run --view web`",
        "not measured",
        "page",
        paging.FIRST,
        {"": 1.0},
        "chromium without a window: from the call of the address to the first paint with content",
    ),
    *(
        Goal(
            f"a keystroke in an editor, {size:,} nodes: {what}",
            f"a prototype: {before}",
            "editing",
            name(size),
            {"": limit},
            "`sar-compile lsp` and pygls' client; time that passes, median",
        )
        for size, before, limits in ((1_000, "80 ms", (0.05, 0.05)), (10_000, "450 ms", (0.1, 0.45)))
        for limit, what, name in zip(
            limits, ("the first answer", "all checked"), (editing.first, editing.checked), strict=True
        )
    ),
)
