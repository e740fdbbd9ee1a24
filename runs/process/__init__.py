"""The process: ranks, signals, exit codes, and whole documents on standard output."""
