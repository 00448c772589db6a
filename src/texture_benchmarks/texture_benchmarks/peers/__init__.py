"""General classifiers of time series on the slides on which the recipes are compared."""
