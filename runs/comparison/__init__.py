"""Finite strain against the linear model: states at equal force and approach, factors, curves between steps."""
