"""A controller of Universal Robots, emulated where the unmodified `ur-rtde` package reaches the real one."""
