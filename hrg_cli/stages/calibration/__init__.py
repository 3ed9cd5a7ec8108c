"""Parts of the stage calibrate."""
