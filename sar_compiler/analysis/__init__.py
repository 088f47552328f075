"""Analyses of a tree's runs: simulation, verification, prediction, Monte Carlo runs, conformance and monitoring."""

PUBLIC_MODULES = (
    "approval",
    "assumptions",
    "bounded_search",
    "conformance",
    "leaf_vocabulary",
    "prediction_view",
    "proofs",
    "runtime_monitor",
    "simulate.scenario_files",
    "simulate.scenario_run",
    "simulated",
    "simulated_tree",
    "sweep",
    "sweep.workers",
    "sweep_runs",
    "sweep_table",
    "trace_view",
    "tree_analysis",
    "trial",
    "verification_view",
    "verify.counterfactual",
    "verify.limits",
    "verify.recorded_runs",
    "verify.verdicts",
)
"""The modules that other parts may import."""
