"""Model files as people have them, MJCF and URDF: read within bounds, and as MuJoCo reads them."""
