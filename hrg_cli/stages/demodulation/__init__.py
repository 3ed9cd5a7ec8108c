"""Parts of the stage demodulate."""
