"""What keeps a frame from matching, and how far it is."""
