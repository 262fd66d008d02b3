"""What the commands for the wheelset alone may be told, one module each."""
