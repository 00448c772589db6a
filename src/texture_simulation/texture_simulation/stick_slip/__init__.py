"""Stick-slip: a fingertip that hangs on its skin and is dragged over a surface with friction."""
