"""The features, one a file; `texture_features.feature_set` lists them."""
