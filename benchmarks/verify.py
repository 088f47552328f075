"""What going through the states of a tree costs: states and ticks a second, and memory.

Run it with `python benchmarks/verify.py`, or with a number of states. The tree is the resilient mission with
more zones than that number needs. Times are seconds of the processor; memory is the most that the process had.
"""

import resource
import sys
import time
from pathlib import Path

from sar_compiler.checks.verify import Progress, read_property_file, verify
from sar_compiler.compiler import bind_main
from sar_compiler.compiler.simulated_tree import Assumptions, compile_simulated
from sar_compiler.nodes.registry import default_registry
from sar_compiler.resources import shipped
from sar_compiler.tree.forest import load_forest
from sar_compiler.tree.reading import read_tree_file

ZONES = 9
MEGABYTE_IN_KILOBYTES = 1024
EVERY_SEC = 10.0


def main(max_states: int) -> None:
    """Measure."""
    registry = default_registry()
    tree = shipped("trees", "search_and_rescue_resilient.xml")
    binding = bind_main(load_forest(tree, read_tree_file), registry)
    simulated = compile_simulated(binding, {}, Assumptions({"zones_left": ZONES}))
    properties = read_property_file(Path(shipped("config", "mission_properties.yaml")))
    tags = {spec.tag for spec in registry if spec.kind.is_leaf}
    last = start = time.process_time()

    def report(progress: Progress) -> None:
        nonlocal last
        if time.process_time() - last > EVERY_SEC:
            last = time.process_time()
            print(f"{progress.states:>10,} states after {last - start:.0f} s", file=sys.stderr)

    found = verify(simulated, properties, tags, max_states, report)
    seconds = time.process_time() - start
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / MEGABYTE_IN_KILOBYTES
    print(
        f"{found.states:,} states, {found.ticks:,} ticks between them: {seconds:.1f} s, {peak:.0f} MiB at most"
    )
    print(f"{found.states / seconds:,.0f} states/s, {seconds / found.ticks * 1e6:.1f} us for each tick")


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 1_000_000)
