"""What is asked of one label: constraints, tolerances, candidates, what the label observes."""
