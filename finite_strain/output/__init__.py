"""Output of a run: fields on disk, and the top surface for pictures."""
