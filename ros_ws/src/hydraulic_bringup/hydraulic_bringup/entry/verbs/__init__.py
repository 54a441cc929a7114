"""The verbs of `./bench`, one per file: docstring, `ORDER` in the help, `run(bench, arguments) -> int`."""
