"""The ROS 2 programs: a simulated cart, and a learner for any cart.

May import everything except `upright.commands`.
"""
