"""The study ``validation``: published results of others, compared with this project's answers."""
