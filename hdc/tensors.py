"""Tensors of a saved model, by the names of its parts, and checks of their types and shapes."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Collection, Mapping

from torch import Tensor

from hdc import bits

Kinds = Mapping[str, str]
"""Name → type and axes, such as ``"int64 L 4 W"``; a letter is a size, W the words of D bits."""

Parts = Mapping[str, Mapping[str, Tensor]]
"""Part of a model → its tensors by name. In a file their names are ``part.name``, of the part
``""`` the bare names."""


def checked(
    tensors: Mapping[str, Tensor], kinds: Kinds, **sizes: int
) -> dict[str, Tensor]:
    """Check types and shapes of tensors; all but packed words are moved to the CPU.

    Args:
        tensors: tensors from a file, which may be anything.
        kinds: their expected types and axes.
        sizes: sizes of letters. A letter without a size may have any size above zero, the same in
            all tensors. D is required for words, whose bits beyond D have to be zero.

    Raises:
        ValueError: for a tensor that is missing, not expected, of another type or shape, or not
            finite.
    """
    if tensors.keys() != kinds.keys():
        raise ValueError(f"expected tensors {[*kinds]}, found {[*tensors]}")
    if "D" in sizes:
        sizes["W"] = bits.words_for(sizes["D"])
    return {
        name: _checked(name, tensors[name], kind, sizes) for name, kind in kinds.items()
    }


def _checked(name: str, tensor: Tensor, kind: str, sizes: dict[str, int]) -> Tensor:
    """One of the tensors; sizes of letters that it is the first to have are added to `sizes`."""
    dtype, *axes = kind.split()
    for axis, size in zip(axes, tensor.shape, strict=False):
        sizes.setdefault(axis, int(axis) if axis.isdigit() else max(1, size))
    expected = tuple(sizes.get(axis) for axis in axes)
    fits = tensor.shape == expected and str(tensor.dtype) == f"torch.{dtype}"
    if not fits or not tensor.isfinite().all():
        raise ValueError(
            f"{name}: expected {kind}, found {tensor.dtype} {tuple(tensor.shape)}"
        )
    if "W" not in axes:
        return tensor.cpu()
    bits.check_padding(tensor, sizes["D"])
    return tensor


def compact(tensor: Tensor) -> Tensor:
    """A tensor without unused memory: of a view, a pickle would hold the whole storage."""
    if tensor.untyped_storage().nbytes() > tensor.nbytes:
        return tensor.clone()
    return tensor


def flat(parts: Parts) -> dict[str, Tensor]:
    """The tensors of all parts of a model, by their names in a file."""
    return {
        f"{part}.{name}" if part else name: tensor
        for part, tensors in parts.items()
        for name, tensor in tensors.items()
    }


def by_part(tensors: Mapping[str, Tensor]) -> defaultdict[str, dict[str, Tensor]]:
    """The tensors of a file by the parts of a model; a part without any is empty."""
    found: defaultdict[str, dict[str, Tensor]] = defaultdict(dict)
    for name, tensor in tensors.items():
        part, dot, own = name.partition(".")
        if dot:
            found[part][own] = tensor
        else:
            found[""][name] = tensor
    return found


def check_parts(found: Parts, allowed: Collection[str]) -> None:
    """Raise ValueError for tensors of another part."""
    if other := found.keys() - set(allowed):
        raise ValueError(f"tensors of {min(other)!r}")
