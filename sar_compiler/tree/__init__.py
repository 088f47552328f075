"""Tree files: parsers and writers for XML and YAML, elements with their locations, and findings."""
