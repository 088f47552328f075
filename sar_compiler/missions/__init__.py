"""The missions that ship with the package, each a plug-in like anybody's."""
