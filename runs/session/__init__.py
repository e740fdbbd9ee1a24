"""One run: its folder, its progress, and how it resumes after an interruption."""
