"""Subcommands of `texture` that this package brings."""
