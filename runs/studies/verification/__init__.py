"""The study ``verification``: the finite-strain model compared with closed forms, published results, and itself."""
