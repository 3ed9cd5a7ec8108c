"""What stands behind a command that is more than one stage on files, and the frame that all
commands share."""
