"""Missions: what one is, which one a tree belongs to, when its run is over; and in a folder each, those that ship."""
