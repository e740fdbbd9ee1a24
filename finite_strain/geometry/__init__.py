"""What is simulated: mirror symmetry, load, how far the model reaches, and estimates that size it. No DOLFINx."""
