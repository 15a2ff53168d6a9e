"""Matches handed on to other tools."""
