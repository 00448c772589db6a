"""ROS nodes of texture_drivers."""
