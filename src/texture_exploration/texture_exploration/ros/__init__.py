"""The only part of texture_exploration beside its nodes that imports ROS."""
