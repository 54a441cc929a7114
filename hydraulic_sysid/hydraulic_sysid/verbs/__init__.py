"""Verbs of the command line: one file, one verb, each with a `main(argv)` that returns the exit code."""
