"""What the commands do over ROS."""
