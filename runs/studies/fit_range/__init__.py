"""The study ``fit_range``: the fit of finite strain's effect in `thirdbody plan`, at the ends of its range."""
