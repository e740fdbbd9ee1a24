"""The study ``strengthening``: T at finite over T at small strain, at equal force or approach, and its causes."""
