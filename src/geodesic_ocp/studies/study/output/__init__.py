"""The tables, figures and files of a study."""
