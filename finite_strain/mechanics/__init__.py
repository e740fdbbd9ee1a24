"""The solid: strain from displacement, strain energy of a law, and volumetric energy."""
