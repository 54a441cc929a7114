"""What talks to the graph."""
