"""Contacts of the momentum QP: each owns its Jacobian, its cone and its load."""
