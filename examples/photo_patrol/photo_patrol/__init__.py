"""A mission for `sar-run` in a separate package: a patrol that takes a photo at each of its points."""
