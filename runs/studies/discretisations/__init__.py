"""The study ``discretisations``: work and precision by element order and size, on five different scenes."""
