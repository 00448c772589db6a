"""Benchmark: classes added slide by slide."""
