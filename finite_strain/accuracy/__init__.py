"""The answer and how far off it may be: pairs with the small-strain problem, and the error budget."""
