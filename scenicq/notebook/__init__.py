"""scenicq from Python: what the commands do, for notebooks and scripts. Start with `datasets.open`."""
