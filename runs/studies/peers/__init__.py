"""The study ``peers``: work and precision for two balls at finite strain, this project compared with other codes."""
