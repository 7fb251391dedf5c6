"""`python -m ridgefeature` is the same as `ridgefeature`."""

from ridgefeature.cli import main

main(prog_name="ridgefeature")
