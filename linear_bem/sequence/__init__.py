"""Sequences of similar scenes, each solved from the previous solution."""
