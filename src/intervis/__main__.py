"""``python -m intervis`` runs the program ``intervis``."""

from intervis.cli import main

if __name__ == "__main__":
    main()
