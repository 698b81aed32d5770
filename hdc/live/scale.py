"""The distances of a frame and the margin between the nearest two, drawn to scale."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from hdc.live.pad import colour

WIDTH, HEIGHT = 200, 22
FARTHEST = 0.5
"""Distance of noise, at the right end."""
_AXIS = 12  # from the top
_DRAWING = """<svg viewBox="-4 0 {width} {height}" width="100%" role="img" aria-label="{label}">
<path d="M0 {axis}H{end}" stroke="#999" stroke-width=".6"/>{parts}
<text x="0" y="{text}" font-size="5" fill="#555">0</text>
<text x="{end}" y="{text}" font-size="5" fill="#555" text-anchor="end">{farthest} = noise</text>
</svg>"""
_MARGIN = '<rect x="{:.2f}" width="{:.2f}" y="9.5" height="5" fill="#222" fill-opacity=".25"/>'
_TICK = '<path d="M{:.2f} 5V{axis}" stroke="{}" stroke-width="1.6"/>'


def drawing(
    distances: Mapping[str, float], margin: float | None, names: Sequence[str]
) -> str:
    """SVG of an axis from 0 to the distance of noise: a tick a class, the margin a grey bar.

    Args:
        distances: share of the bits, by class; larger ones than that of noise are at the end.
        margin: how much farther the second nearest class is; None where there is none.
        names: the classes in the order of their colours.
    """
    parts = []
    label = "no margin"
    if margin is not None:
        first = min(distances.values())
        left, right = _place(first), _place(first + margin)
        parts.append(_MARGIN.format(left, right - left))
        label = f"margin {margin:.3f} on a scale from 0 to {FARTHEST}"
    for name, distance in distances.items():
        look = colour(names, name)
        parts.append(_TICK.format(_place(distance), look, axis=_AXIS))
    return _DRAWING.format(
        width=WIDTH + 8,
        height=HEIGHT,
        end=WIDTH,
        axis=_AXIS,
        text=HEIGHT - 1,
        farthest=FARTHEST,
        label=label,
        parts="".join(parts),
    )


def _place(distance: float) -> float:
    """Place on the axis."""
    return WIDTH * min(distance, FARTHEST) / FARTHEST
