"""What an earthquake does to saturated ground."""
