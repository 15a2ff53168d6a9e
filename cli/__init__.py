"""The command line of scenicq: one file is one command; the only place that prints, reads the environment and exits."""
