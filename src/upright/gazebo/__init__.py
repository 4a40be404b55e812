"""Gazebo 11, the robot simulator: bringing it onto a machine, and finding it there."""
