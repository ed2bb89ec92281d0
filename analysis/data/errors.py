"""The one exception that the command line turns into a sentence."""


class InputError(ValueError):
    """Something in the input that the user has to change. Its message is one or more sentences that say what."""
