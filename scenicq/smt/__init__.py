"""Formulas over real variables and the solvers that decide them. Start at `formula`, then `solver`."""
