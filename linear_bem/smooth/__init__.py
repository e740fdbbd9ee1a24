"""Contacts apart from each other: each the zero line of a polynomial, many balls together."""
