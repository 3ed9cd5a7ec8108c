"""Parts of the stage plan."""
