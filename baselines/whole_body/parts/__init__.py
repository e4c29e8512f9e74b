"""What tasks, contacts and limits of the momentum QP have in common."""
