"""A policy of somebody else before anything is measured with it: what is missing, what is wrong."""
