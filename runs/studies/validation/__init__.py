"""The study ``validation``: results that others published, beside this project's answers."""
