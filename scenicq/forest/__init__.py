"""The expression forest: what a scenario means, and the passes over it. Start with `nodes`."""
