"""From clips of any skeleton to motions of a robot, and from a robot's motions to files."""
