"""The answer and its error: pairs with the small-strain problem, and the error budget."""
