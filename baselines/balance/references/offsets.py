"""The order of what may be added to a controller's choices: one table for all that use it.

Offsets of targets come first, see `update_targets`; those of steps follow, see `StepOffsets` in
`stepping/controller.py`. Horizontal ones are along the axes of a heading.
"""

NAMES = (
    "com_x", "com_y",  # of the CoM [m]
    "cop_x", "cop_y",  # of the CoP [m]
    "com_z",  # [m]
    "lean_x", "lean_y",  # rotation of the root [rad]
    "momentum_x", "momentum_y",  # angular momentum that the posture carries [N·m·s]
    "foothold_x", "foothold_y",  # [m]
    "time",  # from lift-off to touchdown [s]
    "trigger",  # how much further the capture point may leave before a step [m]
)  # fmt: skip
COM_X, COM_Y, COP_X, COP_Y, COM_Z, LEAN_X, LEAN_Y, MOMENTUM_X, MOMENTUM_Y = range(9)
FOOTHOLD_X, FOOTHOLD_Y, TIME, TRIGGER = range(9, 13)
TARGETS = NAMES[:FOOTHOLD_X]  # those of a controller that keeps its feet in place
STEPS = NAMES[FOOTHOLD_X:]
