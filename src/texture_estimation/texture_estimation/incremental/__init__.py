"""Incremental classification: classes added after the training."""
