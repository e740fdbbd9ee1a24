"""The handbook: its pages, what is generated for them, and the command that builds it."""
