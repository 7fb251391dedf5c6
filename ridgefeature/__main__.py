"""The program: `python -m ridgefeature` is the same as `ridgefeature`."""

from ridgefeature.commands import interrupts


def main() -> None:
    """Run the command line; interrupts are heard before anything that takes time to import."""
    interrupts.listen()
    from ridgefeature.cli import main as program

    try:
        program(prog_name="ridgefeature")
    finally:
        interrupts.deafen()


if __name__ == "__main__":
    main()
