"""Hydra takes launchers and sweepers only from the namespace package ``hydra_plugins``; these are thin shells."""
