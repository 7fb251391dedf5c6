"""Numbers for people."""


def number(value: float, digits: int = 4) -> str:
    """So many significant digits, and no exponent for large numbers."""
    return f"{value:,.0f}" if 10**digits <= abs(value) < 1e9 else f"{value:.{digits}g}"
