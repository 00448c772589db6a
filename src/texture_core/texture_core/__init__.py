# SPDX-License-Identifier: Apache-2.0
"""Data types, parameters, catalogues and ROS glue shared by all packages of the suite."""
