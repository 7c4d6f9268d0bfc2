"""`python -m shrm_cli` is `shrm`."""

from shrm_cli.cli.main import main

if __name__ == "__main__":
    main()
