"""The cart-pole in Gazebo 11: the plant, its server, world and window, and an installer.

May import what `upright.plants` may.
"""
