"""An MJCF as text: to the last digit, and with changed numbers."""
