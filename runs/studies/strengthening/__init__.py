"""The study ``strengthening``: T of finite over small strain, at equal force and approach, and what causes it."""
