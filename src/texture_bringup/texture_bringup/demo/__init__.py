"""The demonstration: the whole suite on an emulated bench, from touch to report."""
