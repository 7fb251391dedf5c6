"""What each command of the command line does, one file each; slow imports stand where they are used."""
