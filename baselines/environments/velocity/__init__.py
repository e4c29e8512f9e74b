"""A walk by joint servos alone: the policy follows commanded velocities."""
