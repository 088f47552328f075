"""Rules for mistakes in trees whose parts are each valid by themselves; one module per family."""
