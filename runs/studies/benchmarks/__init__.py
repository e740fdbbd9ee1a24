"""The study ``benchmarks``: time and error against other contact codes, and scaling with the number of balls."""
