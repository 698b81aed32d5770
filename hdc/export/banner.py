"""Description of a header: frames, bits, scores, rejection and sizes."""

from __future__ import annotations

import textwrap

from hdc.export.plan import Plan
from hdc.readouts import LDA

MARK = "Made by hdc export"
"""Text near the beginning of the files of an export; no others are replaced."""
WIDTH = 88
"""Characters of a line of C."""


def banner(plan: Plan, file: str, origin: str) -> str:
    """The comment at the beginning of a header; arguments as of :func:`hdc.export.header`."""
    sizes, name = plan.sizes, plan.name
    paragraphs = [
        f"{file}: which of {sizes.classes} classes a frame is of, in whole numbers.",
        f"{MARK} from {origin}. Encoder {plan.encoder!r}, read-out {plan.readout!r}.",
        _frames_expected(plan),
        _bit_order(plan),
        _score_meaning(plan),
        _rejection_meaning(plan),
        _left_out(plan),
        f"It takes {sizes.constant_bytes} bytes of tables and {sizes.scratch_bytes} of memory "
        f"({name}_scratch), the frame of {sizes.frame_bytes} bytes aside, and allocates nothing. "
        "C99 or C++11. Include it in one source file: each that does has its own tables.",
    ]
    wrapped = [_wrapped(text) for text in paragraphs if text]
    wrapped.append(
        f"     static {name}_scratch scratch;\n"
        f" *     int c = {name}_predict(&scratch, frame);\n"
        f" *     const char *meant = {name}_classes[c];"
    )
    return "/*" + "\n *\n *".join(wrapped) + "\n */"


def has_window(plan: Plan) -> bool:
    """Whether frames are cut out of images by a function of the header."""
    cut = plan.window.crop is not None or plan.window.subsample > 1
    return cut and len(plan.frame_shape) == 2


def _wrapped(text: str) -> str:
    """Lines of a comment, without the ``" *"`` of the first."""
    lines = textwrap.wrap(_comment(text), WIDTH - 3, break_long_words=False)
    return " " + "\n * ".join(lines)


def _comment(text: str) -> str:
    """Text that ends no comment of C and begins none."""
    printable = "".join(c if c.isprintable() else "?" for c in text)
    return printable.replace("*/", "* /").replace("/*", "/ *")


def _frames_expected(plan: Plan) -> str:
    sizes, window = plan.sizes, plan.window
    if len(plan.frame_shape) == 1:
        text = f"Frames: {sizes.pixels} numbers of {sizes.pixel_bits} bits"
    else:
        height, width = plan.frame_shape
        text = (
            f"Frames: {height} rows of {width} grey pixels of {sizes.pixel_bits} bits, row by row "
            "from the top, each from the left"
        )
    if window.crop is not None:
        x, y, width, height = window.crop
        text += f"; of an image, the {width} x {height} pixels from x = {x}, y = {y} on"
    if window.subsample > 1:
        text += f"; one of every {window.subsample} along each axis, from the first on"
    if has_window(plan):
        return f"{text}. {plan.name}_window cuts them out."
    return f"{text}."


def _bit_order(plan: Plan) -> str:
    sizes = plan.sizes
    order = (
        f"Bits: pixel j has at threshold t bit i = {sizes.ranked} t + j of {sizes.dimension}. That "
        "is bit (i mod 64) of word i / 64, where bit 0 is the least significant."
    )
    if sizes.has_lit:
        order += f" Pixels are counted among those of {plan.name}_lit."
    return f"{order} The rest of the last word is 0."


def _score_meaning(plan: Plan) -> str:
    if isinstance(plan.readout, LDA):
        return (
            "Scores: discriminants in the units of hdc.readouts.LDA, the same as in Python. The "
            "largest wins, of equal ones the first."
        )
    return (
        "Scores: minus the Hamming distance to each prototype, the same as in Python. The largest "
        "wins, of equal ones the first."
    )


def _rejection_meaning(plan: Plan) -> str:
    if plan.share is None:
        return ""
    return (
        f"{plan.name}_known: whether a frame is no farther from the majority of some class than "
        f"training frames were that were left out of it, but for a share of {float(plan.share):g}. "
        "Python compares anew for each frame, with a guarantee; this is one distance a class, "
        "without. After drift more frames are refused."
    )


def _left_out(plan: Plan) -> str:
    if not plan.left_out:
        return ""
    return f"Classes without training frames are left out: {', '.join(plan.left_out)}."
