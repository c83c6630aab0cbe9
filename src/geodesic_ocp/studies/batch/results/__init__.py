"""The results of the recordings in the output folder, and the tables from them."""
