"""Equilibrium under a load: Newton's method, its linear systems, and the path along the load."""
