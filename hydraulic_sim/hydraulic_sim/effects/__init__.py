"""The effect library: one effect, one file. The file's name is the effect's name; nothing lists them elsewhere."""
