"""A web page for the operator: what is felt now, buttons to explore, stop, teach and record."""
