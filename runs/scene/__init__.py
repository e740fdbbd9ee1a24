"""Scene files: their keys, units, and what is said about faults."""
