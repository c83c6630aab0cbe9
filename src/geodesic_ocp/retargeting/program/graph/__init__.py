"""The graph of configurations from whose shortest path the program starts."""
