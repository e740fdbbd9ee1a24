"""Three-dimensional pictures from the written fields of a finite-element run: the deformed layer under its balls."""
