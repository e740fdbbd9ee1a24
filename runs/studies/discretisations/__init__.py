"""The study ``discretisations``: work against precision by element order and size, on five different scenes."""
