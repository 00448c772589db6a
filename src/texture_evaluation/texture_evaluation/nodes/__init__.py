"""ROS nodes of texture_evaluation."""
