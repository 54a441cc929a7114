"""Plans that come with the package; load them by name with `load_plan`."""
