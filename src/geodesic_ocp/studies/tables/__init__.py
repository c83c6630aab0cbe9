"""The tidy tables of many recordings: their columns, and files of them."""
