"""The study ``benchmarks``: seconds and errors against other contact codes, and growth with the number of balls."""
