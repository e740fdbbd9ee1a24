"""What a command needs of its process and machine: MPI ranks, signals, exit codes, files, locks, standard output."""
