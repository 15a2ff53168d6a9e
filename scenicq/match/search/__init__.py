"""Search for a correspondence: which label object plays which role, after candidates are pruned."""
