"""The examples are tried with the same means as the missions."""

from tests.e2e.conftest import start, witness

__all__ = ["start", "witness"]
