"""Figures drawn from stored results, one module a figure; characters for the terminal."""
