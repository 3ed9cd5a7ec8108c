"""Parts of `hrg compensate`."""
