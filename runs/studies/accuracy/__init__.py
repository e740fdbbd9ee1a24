"""The study ``accuracy``: error of T against processor time, over models and over every parameter of the solvers."""
