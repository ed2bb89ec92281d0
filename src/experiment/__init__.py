"""The life of a run: planned, owned, launched, recorded. Never imports torch itself.

A module imports only those before it: machine, files, run_directory, state, ownership; plan, cost, progress,
display; process, worker (which loads :mod:`src.training` when a run begins); launch.
"""
