"""Data types, parameters, catalogues and ROS glue shared by all packages of the suite."""
