"""A web page for the operator: what is measured now, buttons to explore, stop, add and record."""
