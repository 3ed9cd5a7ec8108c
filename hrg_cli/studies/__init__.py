"""Experiments of the papers and studies of this project's own methods, as plain figures."""
