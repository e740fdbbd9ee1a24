"""The study ``accuracy``: error of T and processor time for all models and for every parameter of the solvers."""
