"""Public recordings turned into labelled bags, one module a data set."""
