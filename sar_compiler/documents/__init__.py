"""Files beside a tree (scenarios, properties, worlds, maps, settings): their values with locations, checked by schemas."""
