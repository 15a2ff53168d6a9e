"""From datasets of others to ours: one file knows one format, and only here are formats known."""
