"""How many slides are wrong and known under disturbances that were not trained."""
