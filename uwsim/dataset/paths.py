"""Dotted paths into the values of a file, such as `rig.lamps.0.half_angle_deg`; list entries by name or number."""


def put(values: dict, path: str, value: object, *, where: object) -> None:
    """Set the entry at a dotted path. New keys and tables are made; the strict scene model refuses unknown ones."""
    *parents, last = path.split(".")
    node = values
    for key in (*parents, None):
        if not isinstance(node, dict | list):
            raise ValueError(f"{where}: path {path!r} goes into {node!r}, which has no keys")
        if key is not None:
            node = node.setdefault(key, {}) if isinstance(node, dict) else node[_position(node, key, path, where)]
    if isinstance(node, list):
        node[_position(node, last, path, where)] = value
    else:
        node[last] = value


def entry(values: dict, path: str, *, where: object) -> object:
    """Return what stands at a dotted path; ValueError if nothing does."""
    node = values
    for key in path.split("."):
        if isinstance(node, dict) and key in node:
            node = node[key]
        elif isinstance(node, list | tuple):
            node = node[_position(node, key, path, where)]
        else:
            raise ValueError(f"{where}: path {path!r}: no {key!r} there, allowed: a path of the scene that has a value")
    return node


def scaled(value: object, factor: float, path: str, where: object) -> object:
    if isinstance(value, list | tuple):
        return [scaled(one, factor, path, where) for one in value]
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise ValueError(f"{where}: multiply {path!r}: got {value!r} there, allowed: a number or a list of numbers")
    return value * factor


def _position(entries: list, key: str, path: str, where: object) -> int:
    """Return the index of a list entry given by number or by its name."""
    names = [entry.get("name") if isinstance(entry, dict) else None for entry in entries]
    if key in names:
        return names.index(key)
    if key.isdigit() and int(key) < len(entries):
        return int(key)
    raise ValueError(f"{where}: path {path!r}: no entry {key!r}, allowed: {names or 'none'} or their numbers")
