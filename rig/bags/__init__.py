"""Recordings in any container (MCAP, rosbag2, ROS 1) and encoding as arrays."""
