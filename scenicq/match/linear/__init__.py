"""Affine expressions and what linear programs say of them."""
