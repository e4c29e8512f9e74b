"""`poise evaluate`: its course, its folder, its figures."""
