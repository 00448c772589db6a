"""The features, one a file; `texture_features.catalogue` lists them."""
