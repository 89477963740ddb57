"""Recordings in any container (MCAP, rosbag2, ROS 1) and encoding (CDR, JSON, protobuf) as arrays."""
