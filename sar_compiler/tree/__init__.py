"""What a tree file says: elements with the places where they stand, and what reading them can find."""
