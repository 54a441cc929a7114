"""What every node and verb is built from: parameters with units, command lines, tables, orderly ends."""
