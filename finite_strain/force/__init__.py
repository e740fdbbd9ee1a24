"""Evaluation of an equilibrium: in-plane forces by a domain integral, peak pressure, penetration and distortion."""
