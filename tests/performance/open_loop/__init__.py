"""Motions tracked without feedback of balance: targets of servos that samples have found."""
