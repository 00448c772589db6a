"""What of texture_recordings needs ROS."""
