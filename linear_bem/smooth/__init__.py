"""Separate contacts: each pressure is the square root of a polynomial."""
