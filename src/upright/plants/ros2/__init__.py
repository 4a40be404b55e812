"""A cart on ROS 2 topics, simulated or real."""
