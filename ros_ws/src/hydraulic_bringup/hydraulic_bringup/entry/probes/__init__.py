"""What `./bench doctor` looks at, one file per subject: `probe(bench) -> list[Finding]`, `TITLE`, `ORDER`."""
