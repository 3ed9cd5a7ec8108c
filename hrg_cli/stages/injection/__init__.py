"""Parts of the stage inject."""
