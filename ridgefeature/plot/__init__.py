"""Pictures of a registered ridge, as PNG files."""

from ridgefeature.plot.curves import profile
from ridgefeature.plot.deviations import deviation
from ridgefeature.plot.pictures import view

__all__ = ["deviation", "profile", "view"]
