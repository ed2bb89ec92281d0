"""The synthetic studies of ``benchmarks.synthetic``, under the name that older tests know."""

from benchmarks.synthetic import *  # noqa: F403
