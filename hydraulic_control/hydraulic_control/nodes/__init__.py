"""Nodes of this package; the only place in it that knows ROS."""
