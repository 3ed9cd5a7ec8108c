"""Parts of the stage rehearse: the simulated twin of a result and what is held against it."""
