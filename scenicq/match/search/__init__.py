"""Who plays which role: pruning of candidates and search of a correspondence."""
