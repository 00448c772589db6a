"""What is asked of which recorded data, and how it is split."""
