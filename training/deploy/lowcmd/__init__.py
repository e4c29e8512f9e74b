"""A controller on Unitree's messages LowState and LowCmd, and a simulated robot that takes them."""
