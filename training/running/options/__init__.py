"""How options of the command line are told and read: help, spellings, errors of one line."""
