"""The commands, one file each; `evolve` and `study` have packages of their own."""
