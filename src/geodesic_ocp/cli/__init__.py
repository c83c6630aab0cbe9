"""The command line: one module a command, with options from the settings of the package."""
