"""The study ``effects``: code and cost of each optional effect, and proof that no other scene runs its code."""
