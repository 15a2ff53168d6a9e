"""The parts of the syntax tree; `scenicq.syntax.ast` has them all, with their unions."""
