"""What the runs of a tree can come to: simulated, proved, predicted, swept, compared with a record, and watched."""

PUBLIC_MODULES = (
    "approval",
    "assumptions",
    "conformance",
    "leaf_words",
    "prediction_view",
    "proofs",
    "property_watch",
    "simulate.running",
    "simulate.scenario_files",
    "simulated",
    "simulated_tree",
    "sweep",
    "sweep.workers",
    "sweep_table",
    "swept",
    "trace_view",
    "tree_analysis",
    "trial",
    "trying",
    "verification_view",
    "verify.counterfactual",
    "verify.limits",
    "verify.recorded_runs",
    "verify.verdicts",
)
"""The modules that other parts may import."""
