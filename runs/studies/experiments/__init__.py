"""The study ``experiments``: simulation of the paper's drifting balls, compared with its observations."""
