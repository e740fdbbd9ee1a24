"""The study ``effects``: what each optional effect brings in, and that a scene without it pays nothing."""
