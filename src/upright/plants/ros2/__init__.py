"""A cart on ROS 2 topics, simulated or real: the plant, and the messages and node it needs.

May import what `upright.plants` may.
"""
