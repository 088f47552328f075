"""Mutation tests: `python -m tests.mutants` changes the code at random, and reports the changes that no test detects.

A seed selects the changes (mutants) from all changes of `mutating`. Each is applied alone in a copy of the checkout.
Exit status 1 if a mutant survives that is not in `EQUIVALENT`.
"""

import argparse
import itertools
import random
import sys
from contextlib import closing
from pathlib import Path

from tests.mutants.equivalent import EQUIVALENT
from tests.mutants.mutating import Mutant, mutants_of
from tests.mutants.running import Bench

PACKAGES = (
    *(str(path) for path in sorted(Path("sar_compiler").iterdir()) if (path / "__init__.py").is_file()),
    "search_and_rescue",
)


def all_mutants(root: Path, paths: list[str]) -> list[Mutant]:
    """Return all mutants of some modules, and of those in some folders."""
    found = [
        file
        for path in paths
        for file in ([root / path] if path.endswith(".py") else (root / path).rglob("*.py"))
    ]
    return [m for file in sorted(found) for m in mutants_of(str(file.relative_to(root)), file.read_bytes())]


def draw(root: Path, mutants: list[Mutant], seed: int, count: int) -> list[Mutant]:
    """Return random mutants, the same for the same seed; all of them if `count` is 0."""
    order = random.Random(seed).sample(mutants, len(mutants))  # noqa: S311 - reproducible
    possible = (mutant for mutant in order if mutant.is_python((root / mutant.path).read_bytes()))
    return list(itertools.islice(possible, count or None))


def survivors_of(bench: Bench, mutants: list[Mutant]) -> list[Mutant]:
    """Run the tests with each mutant, print the result, and return the mutants that no test detects."""
    found = []
    for number, mutant in enumerate(mutants, 1):
        killer = bench.killer_of(mutant)
        end = f"killed by {killer}" if killer else "SURVIVED"
        _print_line(f"{number}. {mutant.path}:{mutant.line}: {mutant.change}: {end}")
        if not killer:
            found.append(mutant)
    return found


def _print_line(line: str) -> None:
    sys.stdout.write(f"{line}\n")
    sys.stdout.flush()


def main() -> int:
    """Draw mutants and run the tests with each; return the exit status."""
    parser = argparse.ArgumentParser(prog="python -m tests.mutants", description=__doc__.partition("\n")[0])
    parser.add_argument("path", nargs="*", default=PACKAGES, help="modules or folders to change")
    parser.add_argument("--seed", type=int, default=1, help="what the choice depends on")
    parser.add_argument("--count", type=int, default=60, help="how many mutants; 0 for all")
    options = parser.parse_args()
    drawn = draw(Path(), all_mutants(Path(), list(options.path)), options.seed, options.count)
    with closing(Bench(Path(), PACKAGES, Path("build/mutants"))) as bench:
        survivors = survivors_of(bench, drawn)
    known = {(path, text, change) for path, text, change, _why in EQUIVALENT}
    new = [mutant for mutant in survivors if (mutant.path, mutant.text, mutant.change) not in known]
    _print_line(
        f"{len(drawn) - len(survivors)} killed, {len(survivors)} survived, {len(new)} of them without a reason"
    )
    return 1 if new else 0


if __name__ == "__main__":
    sys.exit(main())
