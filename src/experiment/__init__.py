"""The life of a run outside its training: named, planned, owned, launched, recorded. Never imports torch itself.

A module imports only those before it: machine, files, identity, run_directory, state, ownership; checks, plan; cost,
progress, display; process, worker (which loads :mod:`src.training` when a run begins); launch. ``compose`` and
``command_line`` are Hydra's side.
"""
