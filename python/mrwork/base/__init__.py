"""Ground floor: what every room uses, and nothing of dampers or buildings."""
