"""Groups whose vector fields hang on hidden points."""
