"""Exploratory motions, the robots that perform them, and their safety."""
