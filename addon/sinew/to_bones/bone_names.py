"""Files with other names for bones, as an engine's. Pure."""


def read_names(path: str) -> dict[str, str]:
    """Reads a text file with a line `NAME = NEW NAME` for each bone that is to have another name; # begins a comment.
    Returns the new names by the old ones. Raises ValueError, also if the file cannot be read."""
    try:
        with open(path, encoding="utf-8") as file:
            lines = [line.partition("#")[0].strip() for line in file]
    except (OSError, UnicodeDecodeError) as error:
        raise ValueError(f"{path} cannot be read as names of bones: {error}") from error
    names: dict[str, str] = {}
    for number, line in enumerate(lines, 1):
        old, sign, new = (part.strip() for part in line.partition("="))
        if not line:
            continue
        if not (old and sign and new):
            raise ValueError(f"line {number} of {path} is not NAME = NEW NAME: {line}")
        if old in names or new in names.values():
            raise ValueError(f"line {number} of {path} has a name that a line before has: {line}")
        names[old] = new
    return names
