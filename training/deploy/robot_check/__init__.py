"""Checks of a robot description: torque margins, ankle limit, and faults to correct."""
