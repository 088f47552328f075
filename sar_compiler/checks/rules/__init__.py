"""Rules that find mistakes in trees whose every part is right by itself; one module for each family."""
