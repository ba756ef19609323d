"""Bags: MCAP, ROS 1 and ROS 2, whose messages become streams."""
