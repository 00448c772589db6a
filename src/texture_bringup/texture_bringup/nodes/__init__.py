"""ROS nodes of texture_bringup."""
