"""The cart-pole in Gazebo 11: installing it, its world and server, the plant, its window."""
