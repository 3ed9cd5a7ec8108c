"""Parts of the stage diagnose."""
