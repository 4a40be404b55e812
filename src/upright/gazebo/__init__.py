"""Gazebo 11, the robot simulator: bringing it, its server in lock-step, and its window."""
