"""The demonstration: the whole suite on an emulator, from touch to report."""
