"""What every node of the hydraulic bench is built from: parameters with units, command line, orderly ends."""
