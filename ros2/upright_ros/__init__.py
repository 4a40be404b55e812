"""ROS 2 nodes of Upright: a cart-pole that is simulated, and a learner that balances any cart."""
