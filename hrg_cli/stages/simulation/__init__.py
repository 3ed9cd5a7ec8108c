"""The tables of a simulation file, and what of the engines is made of them."""
