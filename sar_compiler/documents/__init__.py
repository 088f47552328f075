"""Files beside a tree (scenarios, properties, worlds, maps, settings): their values with places, checked by schemas."""
