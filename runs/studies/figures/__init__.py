"""The study ``figures``: the paper's figures 8 to 12 and two maps of the sign of T, with their numbers."""
