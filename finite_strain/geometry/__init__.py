"""What is simulated: indenters, mirror symmetry, the box around the balls, estimates that size it. No DOLFINx."""
