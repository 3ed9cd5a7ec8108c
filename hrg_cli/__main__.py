"""`python -m hrg_cli` is the command `hrg`."""

try:
    from .cli import main

    if __name__ == "__main__":
        main()
except KeyboardInterrupt:  # before anything was begun
    raise SystemExit(130) from None
