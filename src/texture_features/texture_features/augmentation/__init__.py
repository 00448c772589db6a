"""Data augmentation: copies of training slides at other speeds, gains and noise levels."""
