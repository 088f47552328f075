"""Read the files used with a tree (scenarios, properties, worlds, maps, settings), and check them with schemas."""
