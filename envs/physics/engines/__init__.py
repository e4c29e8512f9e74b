"""What steps a simulated robot: MuJoCo, or another engine on the same arrays."""
