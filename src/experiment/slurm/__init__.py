"""Running cells as jobs of a Slurm cluster, through submitit. Nothing here is imported unless Slurm is asked for."""
