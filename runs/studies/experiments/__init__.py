"""The study ``experiments``: the paper's drifting balls simulated, and compared with what it reports."""
