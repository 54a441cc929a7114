"""The node of the workbench; the only part of this package that knows ROS."""
