"""The study ``effects``: what each optional effect adds and costs, and that a scene without it pays nothing."""
