"""From a scenario and a dataset to results: necessary conditions as SQL, then the matcher. Start with `run`."""
