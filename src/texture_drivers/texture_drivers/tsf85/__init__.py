"""Robotiq TSF-85 / CoRo fingertip: 28 slow taxels and one fast channel over USB."""
