"""Where the tables of a study come from."""
