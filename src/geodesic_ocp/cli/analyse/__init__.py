"""The command analyse, and options that others share with it."""
