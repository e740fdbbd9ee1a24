"""Scenes that change a little from one to the next."""
