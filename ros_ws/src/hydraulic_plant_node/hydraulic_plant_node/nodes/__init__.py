"""The parts that know ROS."""
