"""The command line: one module per command, its inputs, and its console output."""
