"""`poise evaluate` and `poise benchmark`: course, folder, tables, plots."""
