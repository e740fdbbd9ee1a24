"""One run of a command: output folder, progress, and resumption after an interruption."""
