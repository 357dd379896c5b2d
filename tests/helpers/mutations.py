"""Contents of files and texts with something wrong with them, by chance."""

SIGNS = "\"'[]{}=.,#\n\\-+0e\t\0\r_é\N{MINUS SIGN}\N{LEFT DOUBLE QUOTATION MARK}\N{ZERO WIDTH NO-BREAK SPACE}\ud800"
# Values of TOML and JSON in any place; None stands for none.
VALUES = [
    *(None, True, False, 0, -1, 1, 2**63, 10**400, 0.5, -0.0, float("nan"), float("inf"), 1e308, 5e-324),
    *("", "a", "parabola", "\0", "\ud800", "x" * 10_000, [], {}, [[]], [{}], [0.0, 0.0], [[0.0, 0.0]], ["forward"]),
    *({"uniform": [0.3, 0.8]}, {"uniform": [1]}, {"each": [1, 2]}, {"each": [1, 2], "axis": "a"}, {"choice": []}),
    *({"normal": [0, -1]}, {"log_normal": [1e308, 1e308]}, {"uniform": [-1e308, 1e308]}, {"x": {"y": {}}}),
    *("../outside.nc", "/etc/hostname"),
]


def pick(rng, choices):
    return choices[int(rng.integers(len(choices)))]


def changed_bytes(content, rng):
    """The content with bits flipped, or bytes zeroed, exchanged, copied over others, left out, or cut off."""
    at, size = int(rng.integers(len(content))), int(2 ** rng.uniform(0, 11))
    piece, rest = content[at : at + size], content[at + size :]
    match int(rng.integers(8)):
        case 0 | 1 | 2:
            flipped = bytearray(content)
            for place in rng.integers(len(content), size=int(rng.integers(1, 5))):
                flipped[place] ^= 1 << int(rng.integers(8))
            return bytes(flipped)
        case 3:
            return content[:at] + bytes(len(piece)) + rest
        case 4:
            return content[:at] + rng.bytes(len(piece)) + rest
        case 5:
            begin = int(rng.integers(len(content) - len(piece) + 1))
            return content[:at] + content[begin : begin + len(piece)] + rest
        case 6:
            return content[:at] + rest
        case _:
            return content[:at]


def changed_text(text, rng):
    """The text with characters that are other, too many or too few, or a part that is gone, doubled or repeated."""
    for _ in range(int(rng.integers(1, 4))):
        at, end = sorted(int(place) for place in rng.integers(len(text) + 1, size=2))
        end = min(end, at + 40)
        match int(rng.integers(6)):
            case 0 | 1:
                text = text[:at] + pick(rng, SIGNS) + text[at + int(rng.integers(2)) :]
            case 2:
                text = text[:at] + text[end:]
            case 3:
                text = text[:end] + text[at:]
            case 4:
                text = text[:at] + pick(rng, ["[", "{", "[[", "a.", '"', "{a=", '{"a":', "1"]) * 30_000 + text[at:]
            case _:
                text = text[:at]
    return text


def changed_value(value, rng):
    """The value with another value, or an unknown key, in one of its places."""
    if rng.random() < 0.15 or not isinstance(value, dict | list) or not value:
        return pick(rng, VALUES)
    if isinstance(value, dict):
        if rng.random() < 0.1:
            return value | {pick(rng, ["x", "", "records", "each"]): pick(rng, VALUES)}
        key = pick(rng, list(value))
        if rng.random() < 0.1:
            return {name: one for name, one in value.items() if name != key}
        return value | {key: changed_value(value[key], rng)}
    place = int(rng.integers(len(value)))
    return [*value[:place], changed_value(value[place], rng), *value[place + 1 :]]
