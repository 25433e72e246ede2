"""``python -m intervis`` is the program ``intervis``."""

from intervis.cli import main

if __name__ == "__main__":
    main()
