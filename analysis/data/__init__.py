"""From run directories to frames: read and check each run, put a study together, cut it into cells.

Everything that a number of the report can depend on before statistics begins lies here, so that ``dvc.yaml`` needs one
line for it. Imports nothing else of ``analysis`` but ``analysis.metrics`` (in ``cells``, which no stage ``collect``
uses); every other part of ``analysis`` may import from here.
"""
