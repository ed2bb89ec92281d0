"""The exceptions that become a sentence: on the command line, or among the report's notes."""


class InputError(ValueError):
    """Something in the input that the user has to change. Its message is one or more sentences that say what."""


class UnreadableRunError(InputError):
    """A folder that is no run, or a run whose files cannot be trusted: it costs itself, never the report."""
