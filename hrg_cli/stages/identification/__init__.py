"""Parts of the stage identify."""
