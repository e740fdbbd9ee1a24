"""The study ``verification``: the finite-strain model compared with closed forms, other codes, and itself."""
