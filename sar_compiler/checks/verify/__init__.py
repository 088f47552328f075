"""Verifying a tree: whether properties hold in all of its possible runs.

The tree is compiled with stub leaves and brought into flat form; every combination of answers is played in
every state that can be reached, those that fewest ticks lead to first.
"""

from sar_compiler.checks.verify.comparing import ComparedAnswer, VerificationComparison
from sar_compiler.checks.verify.properties import PropertyFile, parse_property_file, read_property_file
from sar_compiler.checks.verify.verdicts import ProofStatus, Verdict, Verification
from sar_compiler.checks.verify.verifying import verify
from sar_compiler.errors import UndecidableError
from sar_compiler.runtime.kernel.searching import Progress, Report

__all__ = [
    "ComparedAnswer",
    "Progress",
    "ProofStatus",
    "PropertyFile",
    "Report",
    "UndecidableError",
    "Verdict",
    "Verification",
    "VerificationComparison",
    "parse_property_file",
    "read_property_file",
    "verify",
]
