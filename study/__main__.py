"""Entry of `liver-study` and `python -m study`."""

from study.commands import main

if __name__ == "__main__":
    main()
