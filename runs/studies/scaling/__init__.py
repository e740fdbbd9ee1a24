"""The study ``scaling``: time and memory of the linear systems of Newton's method by size, solver, number of ranks."""
