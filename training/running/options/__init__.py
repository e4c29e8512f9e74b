"""Command line options: help, parsing, spellings, one-line errors."""
