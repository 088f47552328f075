"""Measure, compare with the record, write the table.

    python -m benchmarks [--only BENCHMARK]... [--quick] [--save]

Exit status: 0, 1 if a value is much worse than the record or a row has failed, 2 for wrong usage.
"""

import argparse
import sys

from benchmarks import record
from benchmarks.figures import Effort
from benchmarks.running import BENCHMARKS, ROWS, measure_benchmarks

WHOLE, TRIAL = Effort(rounds=8, share=1), Effort(rounds=2, share=0.01)


def main(arguments: list[str] | None = None) -> int:
    """Run the command line; return the exit status."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks", description=__doc__.partition("\n")[0])
    parser.add_argument("--only", action="append", choices=BENCHMARKS, help="measure this; may be repeated")
    parser.add_argument(
        "--quick", action="store_true", help="small trees, to see that it works; writes nothing"
    )
    parser.add_argument("--save", action="store_true", help="make this run the record")
    options = parser.parse_args(arguments)
    if options.quick and options.save:
        parser.error("a trial is no record: --quick does not go with --save")
    names = list(dict.fromkeys(options.only or BENCHMARKS))
    run, is_failed = measure_benchmarks(names, TRIAL if options.quick else WHOLE)
    recorded = record.load(record.RECORD)
    rows = [row for name in names for row in BENCHMARKS[name].rows]
    print(record.write_tables(rows, run))
    # A trial has other trees than the record, of the same names.
    worse = [] if options.quick else record.find_worse(rows, run, recorded)
    for line in worse:
        print(f"worse than recorded: {line}", file=sys.stderr)
    if options.save:
        run = record.merged(run, recorded)
        record.save(ROWS, run, record.RECORD)
    if options.save or (not options.quick and len(names) == len(BENCHMARKS)):
        record.rewrite(ROWS, run, record.PAGE)
    return 1 if is_failed or (worse and not options.save) else 0


if __name__ == "__main__":
    sys.exit(main())
