"""The study ``effects``: code and cost of each optional effect, and proof that a scene without it pays nothing."""
