"""A cart behind ROS 2's topics, simulated or real."""
