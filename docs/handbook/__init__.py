"""The generated parts of the documentation and the man page; no command needs them."""
