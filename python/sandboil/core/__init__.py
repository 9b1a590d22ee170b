"""The numerical core, driven and read in users' terms."""
