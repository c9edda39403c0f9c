"""The command line: options, commands, interrupts and exit codes."""
