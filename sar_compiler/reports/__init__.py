"""Explains recorded missions, and creates statistics and reports about them."""

PUBLIC_MODULES = (
    "checked_journal",
    "compared_runs",
    "explanation",
    "journals",
    "leaf_statistics",
    "report_files",
    "report_forms",
    "run_report",
    "why",
)
"""The modules that other parts may import."""
