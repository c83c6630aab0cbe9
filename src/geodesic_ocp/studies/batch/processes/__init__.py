"""Analyses in processes of this computer, or by an executor such as Dask's."""
