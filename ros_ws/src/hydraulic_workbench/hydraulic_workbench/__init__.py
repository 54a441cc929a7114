"""The bench in a browser: a node and a small web server in one process."""
