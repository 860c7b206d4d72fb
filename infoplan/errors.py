"""The two errors that a user sees as one sentence."""


class UsageError(ValueError):
    """What was asked for cannot be done: names it, what is allowed, what to do (exit status 2)."""


class RunError(RuntimeError):
    """A run was well asked for and failed on its way (exit status 1)."""
