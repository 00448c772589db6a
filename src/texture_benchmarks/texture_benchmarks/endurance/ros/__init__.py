"""What an endurance run needs of a running ROS graph."""
