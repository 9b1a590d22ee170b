"""Comparisons with closed forms, other codes and experiments: one folder for each case."""
