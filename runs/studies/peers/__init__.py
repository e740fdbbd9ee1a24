"""The study ``peers``: accuracy and time for two balls at finite strain, compared with other codes."""
