"""The study ``discretisations``: work against precision of the elements' order and size, on five unlike scenes."""
