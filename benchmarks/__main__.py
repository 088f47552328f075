"""Measure, compare with the record, write the tables.

    python -m benchmarks [--only BENCHMARK]... [--quick] [--save]

Exit status: 0, 1 if a ratio is much worse than the record or a benchmark has failed, 2 for wrong usage.
"""

import argparse
import sys

from benchmarks import record, tables
from benchmarks.figures import Effort
from benchmarks.running import BENCHMARKS, measured

WHOLE, TRIAL = Effort(rounds=7, share=1), Effort(rounds=2, share=0.01)


def main(arguments: list[str] | None = None) -> int:
    """Do what the command line says; return the exit status."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks", description=__doc__.partition("\n")[0])
    parser.add_argument("--only", action="append", choices=BENCHMARKS, help="measure this; may be repeated")
    parser.add_argument(
        "--quick", action="store_true", help="small trees, to see that it works; writes nothing"
    )
    parser.add_argument("--save", action="store_true", help="let this run be the record")
    options = parser.parse_args(arguments)
    if options.quick and options.save:
        parser.error("a trial is no record: --quick does not go with --save")
    names = list(dict.fromkeys(options.only or BENCHMARKS))
    run, failed = measured(names, TRIAL if options.quick else WHOLE)
    for name in names:
        print(f"\n{name}\n\n{tables.benchmark_table(run, name)}")
    if not options.quick and len(names) == len(BENCHMARKS):
        tables.rewrite(run, tables.README)
    recorded = record.load(record.RECORD)
    # A trial has other trees than the record, of the same names.
    worse = [] if options.quick else record.worse(run, recorded)
    for line in worse:
        print(f"worse than recorded: {line}", file=sys.stderr)
    if options.save:
        merged = record.merged(run, recorded)
        record.save(merged, record.RECORD)
        tables.rewrite(merged, tables.README)
    return 1 if failed or (worse and not options.save) else 0


if __name__ == "__main__":
    sys.exit(main())
