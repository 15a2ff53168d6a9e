"""Warnings of what compiles but cannot be meant, each with a code and a comment that silences it."""
