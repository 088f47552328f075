"""What the runs of a tree can come to: simulated, proved, predicted, swept, compared with a record, and watched."""
