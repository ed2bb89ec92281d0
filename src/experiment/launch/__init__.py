"""How planned runs are started: a process each on this machine, or jobs of a Slurm cluster."""
