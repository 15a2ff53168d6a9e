"""Necessary conditions of a scenario as SQL, and what it leaves."""
