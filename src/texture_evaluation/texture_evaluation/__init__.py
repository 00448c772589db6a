"""Bags and data sets, experiments, metrics and charts."""
