"""Tests of `scenicq.geometry`."""
