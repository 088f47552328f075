"""What is reported of a mission afterwards: explanations, statistics and reports."""
