"""A patrol that takes a photo at each of its points: a mission for `sar-run` in a package of its own."""
