"""Formatting of numbers, tables on the terminal, and figures."""
