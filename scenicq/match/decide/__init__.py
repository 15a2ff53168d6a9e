"""Is one group of constraints satisfiable? The steps of the cascade."""
