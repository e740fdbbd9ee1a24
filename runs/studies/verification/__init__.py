"""The study ``verification``: the finite-strain model against closed forms, published results, and itself."""
