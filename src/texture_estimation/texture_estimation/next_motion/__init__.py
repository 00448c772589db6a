"""Choice of the next exploration."""
