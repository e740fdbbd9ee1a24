"""Pictures in three dimensions of what a finite-element run has written: the deformed layer under its balls."""
