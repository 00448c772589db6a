"""ROS nodes of texture_recordings."""
