"""Fields on disk and the surface for pictures."""
