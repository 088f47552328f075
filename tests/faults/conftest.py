"""Faults are tried with the means of whole missions."""

from tests.e2e.conftest import start, witness

__all__ = ["start", "witness"]
