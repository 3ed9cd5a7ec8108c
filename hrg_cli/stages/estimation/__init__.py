"""Parts of the stage estimate."""
