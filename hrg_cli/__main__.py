"""`python -m hrg_cli` is the command `hrg`."""

from .cli import main

if __name__ == "__main__":
    main()
