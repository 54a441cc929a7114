"""Top floor: the entry `./bench`, launch files, parameter files and the demo."""
