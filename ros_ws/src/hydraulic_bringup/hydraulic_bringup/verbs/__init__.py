"""Commands of this package: one verb, one file."""
