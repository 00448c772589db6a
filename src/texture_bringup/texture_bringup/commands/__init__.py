"""The sub-commands of `texture`, one module each."""
