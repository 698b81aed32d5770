"""The header itself, put together from the pieces of C in the folder ``c``."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from importlib.resources import files
from string import Template

import numpy as np

from hdc.export.banner import WIDTH, banner, has_window
from hdc.export.plan import Plan
from hdc.readouts import LDA

_FIRST_RULES = {
    "raster": ("Ties: the first pixels of the frame become ones.", "missing"),
    "below": (
        "Ties: all become ones where they fit exactly, else none.",
        "missing == equal ? equal : 0",
    ),
}
"""Rules that take ties from the first on: what they say, and how many they take."""


def header(plan: Plan, file: str, origin: str) -> str:
    """The text of the header.

    Args:
        plan: what it is made of.
        file: its name.
        origin: where the model is from, in words.
    """
    return piece(
        "header.h",
        plan,
        banner=banner(plan, file, origin),
        sizes=_sizes(plan),
        pixel=f"uint{plan.sizes.pixel_bits}_t",
        fields=_fields(plan),
        tables=_tables(plan),
        encoding=_encoding(plan),
        classes=_classes(plan),
        after=_after(plan),
    )


def piece(source: str, plan: Plan, /, **words: object) -> str:
    """A piece of C with its names filled in."""
    template = Template(files("hdc.export").joinpath("c", source).read_text("utf-8"))
    return template.substitute(name=plan.name, NAME=plan.name.upper(), **words)


def rows_of(numbers: Sequence[str], indent: int = 4) -> str:
    """Numbers, as many on a line as there is room for."""
    return textwrap.fill(
        ", ".join(numbers),
        WIDTH,
        initial_indent=" " * indent,
        subsequent_indent=" " * indent,
    )


def nested(table: np.ndarray, depth: int = 1) -> str:
    """Rows of a table between braces, as deep as it has axes."""
    if table.ndim > 1:
        blank = " " * (4 * depth)
        inner = [nested(part, depth + 1) for part in table]
        return ",\n".join(f"{blank}{{\n{text}\n{blank}}}" for text in inner)
    if table.dtype == np.uint64:
        numbers = [f"0x{word:016x}" for word in table.tolist()]
    else:
        numbers = [str(number) for number in table.tolist()]
    return rows_of(numbers, 4 * depth)


def quoted(text: str) -> str:
    """A string of C; other than plain characters as the octal numbers of their UTF-8 bytes."""
    characters = []
    for byte in text.encode():
        plain = 32 <= byte < 127 and chr(byte) not in '"\\?'
        characters.append(chr(byte) if plain else f"\\{byte:03o}")
    return f'"{"".join(characters)}"'


# Numbers and tables ------------------------------------------------------------------------------


def _sizes(plan: Plan) -> str:
    sizes = plan.sizes
    numbers = [("PIXELS", sizes.pixels, "of a frame")]
    if len(plan.frame_shape) == 2:
        height, width = plan.frame_shape
        numbers += [("HEIGHT", height, "rows"), ("WIDTH", width, "pixels of a row")]
    numbers += [
        ("RANKED", sizes.ranked, "pixels that become bits"),
        ("THRESHOLDS", sizes.thresholds, "bits of a pixel"),
        ("BITS", sizes.dimension, "of a hypervector"),
        ("WORDS", sizes.words, "of 64 of them"),
        ("CLASSES", sizes.classes, "places of scores and names"),
    ]
    lines = []
    for key, value, meaning in numbers:
        define = f"#define {plan.name.upper()}_{key} {value}"
        lines.append(f"{define:<36} /* {meaning} */")
    return "\n".join(lines)


def _fields(plan: Plan) -> str:
    """Fields of the scratch."""
    prefix = plan.name.upper()
    fields = [
        (f"uint64_t hypervector[{prefix}_WORDS];", "of the last frame"),
        (f"int64_t scores[{prefix}_CLASSES];", "the largest wins"),
    ]
    if plan.sizes.relative:
        fields.append((f"int64_t levels[{prefix}_THRESHOLDS];", "of the last frame"))
    elif plan.sizes.pixel_bits == 8:
        fields.append(("uint32_t counts[256];", "pixels of each value"))
    else:
        fields.append(("uint32_t counts[256];", "pixels of each high byte"))
        fields.append(("uint32_t low_counts[256];", "of each low byte under one"))
    if plan.sizes.ties == "spread":
        fields.append(("uint32_t turns[64];", "pixels at the threshold by turn"))
    if plan.sizes.has_lit:
        field = f"{plan.name}_pixel lit[{prefix}_RANKED];"
        fields.append((field, "the pixels that are ranked"))
    return _commented(fields)


def _level(plan: Plan) -> str:
    """Fields of a threshold."""
    above = ("uint32_t value;", "pixels above it become ones")
    if plan.sizes.ties != "spread":
        return _commented([above, ("uint32_t room;", "and so many of those at it")])
    turns = ("uint32_t turns;", "of those at it, all with a lower turn")
    return _commented([above, turns, ("uint32_t room;", "and so many with this turn")])


def _commented(fields: Sequence[tuple[str, str]]) -> str:
    width = max(len(field) for field, _ in fields)
    return "\n".join(
        f"    {field:<{width}} /* {meaning} */" for field, meaning in fields
    )


def _tables(plan: Plan) -> str:
    """All tables, hypervectors first."""
    count = f"{plan.name.upper()}_CLASSES"
    words = f"{plan.name.upper()}_WORDS"
    kinds = {
        "prototypes": ("uint64_t", f"[{count}][{words}]"),
        "weights": ("uint64_t", f"[{count}][4][{words}]"),
        "majority": ("uint64_t", f"[{count}][{words}]"),
        "lit": ("uint64_t", f"[({plan.name.upper()}_PIXELS + 63) / 64]"),
        "scales": ("int64_t", f"[{count}]"),
        "biases": ("int64_t", f"[{count}]"),
        "thresholds": ("int64_t", f"[{count}]"),
        "ones": ("uint32_t", f"[{plan.name.upper()}_THRESHOLDS]"),
        "reference": ("int32_t", f"[{plan.name.upper()}_PIXELS]"),
        "numerators": ("int32_t", f"[{plan.name.upper()}_THRESHOLDS]"),
        "denominators": ("int32_t", f"[{plan.name.upper()}_THRESHOLDS]"),
    }
    meanings = {
        "prototypes": "The prototype of each class.",
        "weights": "Weights of each class, from -7 to 7, as q + 8 in planes of bits.",
        "majority": "The majority of each class, which tells what is like none of them.",
        "lit": "Pixels that were lit in training.",
        "scales": "Factors of the weights of each class.",
        "biases": "Numbers that are added to the score of each class.",
        "thresholds": "How far from its majority a frame of each class may be.",
        "ones": "How many pixels are ones, for each threshold.",
        "reference": "The frame that is subtracted, in steps of 1/65536 of a deviation.",
        "numerators": "Thresholds in deviations, numerators of fractions,",
        "denominators": "and their denominators.",
    }
    parts = [_names(plan)]
    for name, (kind, shape) in kinds.items():
        if name not in plan.tables:
            continue
        start = f"static const {kind} {plan.name}_{name}{shape} = {{"
        content = nested(plan.tables[name])
        parts.append(f"/* {meanings[name]} */\n{start}\n{content}\n}};")
    return "\n\n".join(parts)


def _names(plan: Plan) -> str:
    start = f"static const char *const {plan.name}_classes[{plan.name.upper()}_CLASSES] = {{"
    lines = [f"    {quoted(name)}," for name in plan.classes]
    return "\n".join([start, *lines, "};"])


# Functions ---------------------------------------------------------------------------------------


def _encoding(plan: Plan) -> str:
    if plan.sizes.relative:
        pieces = [piece("root.h", plan), piece("encode_deviation.h", plan)]
        return "\n".join(pieces).rstrip()
    parts = [piece("level.h", plan, level=_level(plan)), piece("descend.h", plan)]
    if plan.sizes.ties == "spread":
        parts.append(piece("ties_spread.h", plan))
    else:
        rule, room = _FIRST_RULES[plan.sizes.ties]
        parts.append(piece("ties_first.h", plan, rule=rule, room=room))
    parts.append(piece(f"select_{plan.sizes.pixel_bits}.h", plan))
    if plan.sizes.has_lit:
        parts.append(piece("lit.h", plan))
    pixels = f"{plan.name}_lit_pixels(s, frame)" if plan.sizes.has_lit else "frame"
    parts.append(piece("encode_ranks.h", plan, pixels=pixels))
    return "\n".join(parts).rstrip()


def _classes(plan: Plan) -> str:
    parts = [piece("popcount.h", plan)]
    weighted = isinstance(plan.readout, LDA)
    if not weighted or plan.sizes.extra:
        parts.append(piece("distance.h", plan))
    parts.append(piece("score_weights.h" if weighted else "score_prototypes.h", plan))
    return "\n".join(parts).rstrip()


def _after(plan: Plan) -> str:
    """Functions beside the prediction."""
    parts = []
    if plan.share is not None:
        distance = "-s->scores[c]"
        if plan.sizes.extra:
            distance = f"{plan.name}_distance(s->hypervector, {plan.name}_majority[c])"
        parts.append(piece("known.h", plan, distance=distance))
    if has_window(plan):
        x, y = (plan.window.crop or (0, 0))[:2]
        step = plan.window.subsample
        parts.append(piece("window.h", plan, x0=x, y0=y, step=step))
    return "".join(parts)
