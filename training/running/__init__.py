"""Running anything long: processes, terminal, files, and where a result comes from."""
