"""Training package of the testbed. It never imports ``analysis``."""
