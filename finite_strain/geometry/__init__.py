"""The part to simulate: mirror symmetry, load, extent of the model, and estimates that set its size (no DOLFINx)."""
