"""How anything long is run: processes, terminal, files, and where a result comes from."""
