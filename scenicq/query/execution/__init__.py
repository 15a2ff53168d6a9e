"""Queries as they run: blocks, workers, shards, results."""
