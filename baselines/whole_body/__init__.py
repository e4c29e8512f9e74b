"""The momentum QP: tasks, contacts and limits, as the papers write it and compiled."""
