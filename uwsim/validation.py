"""Filling a model from a file's content; what is wrong with it in one line: where, key, got, allowed."""

import re
from collections.abc import Iterable
from typing import TypeVar

from pydantic import TypeAdapter, ValidationError

Model = TypeVar("Model")


def with_tuples(value: object) -> object:
    """Return a parsed TOML or JSON value with its lists as tuples, as strict models want them."""
    if isinstance(value, dict):
        return {key: with_tuples(item) for key, item in value.items()}
    return tuple(with_tuples(item) for item in value) if isinstance(value, list) else value


# what is allowed, by pydantic's name of the problem
_ALLOWED = {
    **dict.fromkeys(("float_type", "float_parsing"), "a number"),
    **dict.fromkeys(("int_type", "int_parsing", "int_from_float"), "a whole number"),
    **dict.fromkeys(("bool_type", "bool_parsing"), "true or false"),
    **dict.fromkeys(("tuple_type", "list_type"), "a list"),
    **dict.fromkeys(("model_type", "model_attributes_type", "dict_type", "dataclass_type"), "a table"),
    "string_type": "text",
    "path_type": "the path of a file",
    "none_required": "null",
    "finite_number": "a finite number",
    "greater_than": "> {gt:g}",
    "greater_than_equal": ">= {ge:g}",
    "less_than": "< {lt:g}",
    "less_than_equal": "<= {le:g}",
    "too_short": "at least {min_length} entries",
    "too_long": "at most {max_length} entries",
    "string_too_short": "at least {min_length} character(s)",
    "string_pattern_mismatch": "text of the form {pattern}",
    "literal_error": "{expected}",
    "union_tag_invalid": "{expected_tags}",
}


def validated(model: type[Model], values: object, *, where: object) -> Model:
    """Fill a strict model or dataclass; ValueError in one line naming `where`, key, value and what is allowed."""
    try:
        return TypeAdapter(model).validate_python(values)
    except ValidationError as error:
        # too few entries are also reported where entries were left out because they are wrong themselves
        problems = [
            p for p in error.errors(include_url=False)
            if p["type"] != "too_short" or len(p["input"]) < p["ctx"]["min_length"]
        ]  # fmt: skip
        text = _describe(_best_branch(problems, values), model, values)
    raise ValueError(f"{where}: {' '.join(text.split())}")


def _best_branch(problems: list[dict], values: object, depth: int = 0) -> list[dict]:
    """Return the problems of one place: where a union reports every branch, of the branch that fits best."""
    # an unknown key tells more than the key that is missing in its place
    first = min(problems, key=lambda problem: problem["type"] == "missing")
    for index in range(depth, len(first["loc"])):
        if not _is_branch(first, index, values):
            continue
        branches: dict[object, list[dict]] = {}
        for problem in problems:
            if problem["loc"][:index] == first["loc"][:index] and len(problem["loc"]) > index:
                branches.setdefault(problem["loc"][index], []).append(problem)
        entered = [found for name, found in branches.items() if not _is_other_kind(found, index)]
        if entered:
            return _best_branch(min(entered, key=len), values, index + 1)
        return [problem for found in branches.values() for problem in found]
    return [first]


def _is_other_kind(problems: list[dict], index: int) -> bool:
    """Whether a branch of a union was not even entered: a table where a number stands, or the reverse."""
    kind = problems[0]["type"]
    return len(problems[0]["loc"]) == index + 1 and kind.endswith(("_type", "_parsing"))


def _is_branch(problem: dict, index: int, values: object) -> bool:
    """Whether an entry of a location names a branch of a union rather than a key of the values."""
    if problem["type"] == "missing" and index == len(problem["loc"]) - 1:
        return False
    return len(_keys(problem["loc"][: index + 1], values)) == len(_keys(problem["loc"][:index], values))


def _keys(location: Iterable, values: object) -> list:
    """Return the entries of a location that are keys of the values, without the names of union branches."""
    found, node = [], values
    for part in location:
        if isinstance(node, dict):
            inside = part in node
        else:
            inside = isinstance(node, list | tuple) and isinstance(part, int) and part < len(node)
        if inside:
            found.append(part)
            node = node[part]
    return found


def _describe(problems: list[dict], model: type, values: object) -> str:
    first = problems[0]
    keys = _keys(first["loc"], values)
    match first["type"]:
        case "missing":
            return f"{_dotted([*keys, first['loc'][-1]])}: missing"
        case "extra_forbidden":
            known = _known_keys(model, first["loc"][:-1])
            return f"{_dotted(keys)}: unknown key, allowed: {', '.join(known)}"
        case "union_tag_not_found":
            key = _dotted([*keys, first["ctx"]["discriminator"].strip("'")])
            return f"{key}: missing, allowed: {', '.join(map(repr, _known_keys(model, first['loc'])))}"
        case "union_tag_invalid":
            keys, got = [*keys, first["ctx"]["discriminator"].strip("'")], repr(first["ctx"]["tag"])
        case "value_error":
            # raised by the model itself, which says what it got and what is allowed
            message = str(first["ctx"]["error"])
            key, colon, rest = message.partition(": ")
            if keys and colon and key in _known_keys(model, first["loc"]):
                return f"{_dotted([*keys, key])}: {rest}"
            return f"{_dotted(keys)}: {message}" if keys else message
        case _:
            got = _shown(first["input"])
    allowed = dict.fromkeys(_ALLOWED.get(p["type"], p["msg"]).format(**p.get("ctx", {})) for p in problems)
    return f"{_dotted(keys) or 'content'}: got {got}, allowed: {' or '.join(allowed)}"


def _dotted(keys: list) -> str:
    return ".".join(map(str, keys))


def _shown(value: object) -> str:
    if isinstance(value, dict):
        return "a table"
    text = repr(list(value) if isinstance(value, tuple) else value)
    return text if len(text) <= 80 else f"{text[:77]}..."


def _known_keys(model: type, location: tuple) -> list[str]:
    """Return the keys of the table at a location, or the tags of the union there, from the model's schema."""
    schema = TypeAdapter(model).json_schema()

    def resolved(node: dict) -> dict:
        while "$ref" in node:
            node = schema["$defs"][node["$ref"].rpartition("/")[2]]
        return node

    node = resolved(schema)
    for part in location:
        options = [option for option in node.get("anyOf", node.get("oneOf", [])) if "$ref" in option]
        if part in node.get("properties", {}):
            node = node["properties"][part]
        elif "discriminator" in node:
            node = {"$ref": node["discriminator"]["mapping"][part]}
        elif options:
            # a branch is named after its class, within the names of the class's validators
            names = [option["$ref"].rpartition("/")[2] for option in options]
            mine = [option for option, name in zip(options, names, strict=True) if re.search(rf"\b{name}\b", str(part))]
            if not mine:  # a branch that is no table
                return []
            node = mine[0]
        elif isinstance(part, int):
            node = [*node.get("prefixItems", []), *[node.get("items")] * (part + 1)][part]
        else:
            node = node["additionalProperties"]
        node = resolved(node)
        tables = [option for option in node.get("anyOf", []) if option.get("type") != "null"]
        if len(tables) == 1:  # an optional table
            node = resolved(tables[0])
    return list(node["discriminator"]["mapping"] if "discriminator" in node else node.get("properties", {}))
