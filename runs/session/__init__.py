"""One run: its folder, its progress, and how it goes on after an interruption."""
