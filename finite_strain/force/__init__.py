"""What is measured in an equilibrium: the in-plane forces by a domain integral, peak pressure and penetration."""
