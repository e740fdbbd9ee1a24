"""The study ``peers``: work against precision for two balls at finite strain, this project beside other codes."""
