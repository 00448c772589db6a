"""ROS nodes of texture_simulation."""
