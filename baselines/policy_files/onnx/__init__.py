"""Files of networks, read within bounds."""
