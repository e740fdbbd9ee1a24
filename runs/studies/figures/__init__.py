"""The study ``figures``: the paper's figures 8 to 12 and maps of the sign of T, with the numbers they show."""
