"""ROS nodes of texture_estimation."""
