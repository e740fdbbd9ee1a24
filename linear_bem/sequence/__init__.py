"""Sequences of scenes that change a little from one to the next."""
