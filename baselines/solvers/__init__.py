"""Dense QP solvers behind one interface."""
