"""What the benchmarks need of a running ROS graph."""
