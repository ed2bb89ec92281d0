"""Hydra takes launchers and sweepers only from the namespace package ``hydra_plugins``; the work is done elsewhere."""
