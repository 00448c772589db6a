"""ROS nodes of texture_exploration."""
