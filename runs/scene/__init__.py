"""Scene files: their keys, units, and messages about faults."""
