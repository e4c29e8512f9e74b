"""Motion clips of any skeleton: files of motion capture, what is done with them, planted feet."""
