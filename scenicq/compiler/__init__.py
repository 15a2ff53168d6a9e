"""From a syntax tree to a scenario: evaluates a program with a map. Start with `program`."""
