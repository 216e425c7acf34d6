"""The protocol: both ends against each other, and any bytes whatever."""
