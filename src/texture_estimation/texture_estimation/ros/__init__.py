"""ROS parts of the estimation that are not nodes."""
