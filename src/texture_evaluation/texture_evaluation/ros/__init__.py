"""ROS parts of the evaluation that are not nodes."""
