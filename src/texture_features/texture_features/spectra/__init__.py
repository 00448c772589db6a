"""Spectra that several features share."""
