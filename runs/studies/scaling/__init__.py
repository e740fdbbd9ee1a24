"""The study ``scaling``: time and memory of Newton's linear systems by size, solver and number of ranks."""
