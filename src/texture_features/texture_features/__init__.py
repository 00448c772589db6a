"""Windows of a tactile signal and the features that describe them."""
