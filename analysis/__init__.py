"""From run directories to the paper's figures, statistics and verdicts. Imports neither torch nor the training code."""
