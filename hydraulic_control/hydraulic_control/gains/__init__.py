"""Parameter files that `tune` has written for presets."""
