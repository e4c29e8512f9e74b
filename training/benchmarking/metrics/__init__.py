"""The figures of a result are computed here, from trials and how they ended."""
