"""Results made visible: pictures of frames, the report of a query, two results compared. Start with `picture`."""
