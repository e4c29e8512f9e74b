"""The language in which a motion is asked for: words, tree, print, and a table of the same."""
