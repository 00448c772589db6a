"""The only part of texture_core that imports ROS."""
