"""What is simulated: mirror symmetry, load, extent of the model, and estimates that set its size. No DOLFINx."""
