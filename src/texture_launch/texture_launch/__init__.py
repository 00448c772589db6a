"""A stand-alone launcher for the part of ROS 2's XML launch files that the suite uses."""
