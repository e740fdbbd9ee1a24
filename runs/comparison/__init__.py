"""Comparison of finite strain with the linear model: states at equal force or approach, ratios, sensitivities."""
