"""The study ``discretisations``: accuracy and time by element order and size, on five different scenes."""
