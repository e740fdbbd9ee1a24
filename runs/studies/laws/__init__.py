"""The study ``laws``: how far T and its strengthening depend on the hyperelastic law, and what a foam does."""
