"""An assertion that holds under `python -O`, and says by itself what is wrong."""


def require(is_met: object, what: str) -> None:
    """Fail a test.

    Args:
        is_met: Whether the requirement is met.
        what: The requirement, a sentence without its end.

    Raises:
        AssertionError: It is not met.

    """
    if not is_met:
        raise AssertionError(what)
