"""The root of every error that is up to the user's input, files or bench, and not to the program."""


class HydraulicError(Exception):
    """Its text says what is wrong, where, with which value, and what is allowed; a command line prints it and ends."""

    exit_code = 2
    """Of the command line that it ends: 2 where the input is at fault, 1 where that was fine but the work failed."""


def one_line(error: BaseException, most: int | None = None) -> str:
    """What another library's error says, in one line of ``most`` characters; its kind where it says nothing."""
    return " ".join(str(error).split())[:most] or type(error).__name__
