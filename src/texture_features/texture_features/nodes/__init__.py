"""ROS nodes of texture_features."""
