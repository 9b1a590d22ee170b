"""Files of every kind: read bounded and checked, written whole."""
